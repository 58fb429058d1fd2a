// Coefficients of Radau IIA of order 5.
#pragma once

#include "cutjoint/core/stepping/coefficients.hpp"

namespace cutjoint::radau {

/// The collocation method of order 5 whose last stage is the end of the step, with an estimate of order 3.  Source: Hairer, Wanner, Solving Ordinary
/// Differential Equations II (1996), sections IV.5 and IV.8.  The first number of each row is the weight of the derivative at the step's start.
struct Table {
  static constexpr int order = 4;  ///< that of the estimate and one, which steps follow
  static constexpr std::size_t stages = 3;
  using Row = Decimals<stages + 1>;
  using Square = std::array<Decimals<stages>, stages>;

  static constexpr Row nodes{{{0}, {0.1550510257216822, -5.032819811655113e-18}, {0.6449489742783178, 4.389062567353559e-17}, {1}}};
  static constexpr std::array<Row, stages + 1> weights{{
      {},
      {{{0}, {0.1968154772236604, 1.3670172167093432e-17}, {-0.06553542585019839, 4.064007010672966e-18}, {0.02377097434822015, 1.5191296742537875e-18}}},
      {{{0}, {0.3944243147390873, -1.245235875228526e-17}, {0.2920734116652285, -2.5389192982581196e-17}, {-0.04154875212599793, -1.5345494384846924e-18}}},
      {{{0}, {0.37640306270046725, 2.4815593689300885e-17}, {0.5124858261884216, -3.0983499381662866e-17}, {0.1111111111111111, 6.1679056923619804e-18}}},
  }};
  static constexpr Row error{{{0.27488882959567734, 2.575969278135112e-17},
                              {-0.42829829411536813, 2.3218412753295885e-17},
                              {0.24503907438491654, -1.2635965658567718e-17},
                              {-0.0916296098652258, 5.291223547364084e-18}}};

  /// The eigenvalues of the weights: a real one, and one of a pair with its imaginary part.  With the matrix T of their eigenvectors, real and imaginary parts
  /// side by side, and its inverse, weights T = T [gamma, 0, 0; 0, real, -imaginary; 0, imaginary, real].
  static constexpr Decimal gamma{0.27488882959567734, 2.575969278135112e-17};
  static constexpr Decimal real{0.16255558520216132, -1.777616144423994e-18}, imaginary{0.1849493244071408, -7.306747133416648e-18};
  static constexpr Square vectors{{
      {{{0.09443876248897524, -3.2368750750185867e-18}, {-0.1412552950209542, 5.097153543846629e-18}, {0.030029194105147424, 3.6542704232425183e-19}}},
      {{{0.2502131229653333, -1.193443450208261e-17}, {0.20412935229379994, -1.0734254978581646e-17}, {-0.3829421127572619, -1.6787670664719064e-17}}},
      {{{1}, {1}, {0}}},
  }};
  static constexpr Square inverse{{
      {{{4.178718591551905, -4.4308719350849406e-16}, {0.32768282076106237, 2.152707279858693e-17}, {0.5233764454994495, 4.281235710695699e-17}}},
      {{{-4.178718591551905, 4.4308719350849406e-16}, {-0.32768282076106237, -2.152707279858693e-17}, {0.47662355450055044, 1.2698794124300841e-17}}},
      {{{0.5028726349457868, 5.3182437800090116e-17}, {-2.571926949855605, -2.135976914942942e-16}, {0.5960392048282249, 2.7519602968112386e-18}}},
  }};
};

}  // namespace cutjoint::radau
