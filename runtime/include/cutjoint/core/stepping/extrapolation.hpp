// The accelerations that a step is expected to end with.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/largest.hpp"
#include "cutjoint/core/numbers/selection.hpp"

namespace cutjoint {

/// The polynomial through the accelerations at the ends of the last steps, of a degree up to 3.
///
/// It is kept as backward differences, of which that of order k + 1 is what the polynomial of degree k was off the last step's end.  They are added as
/// long as they fall, so that accelerations that oscillate from step to step are expected to stay.  Of several instances side by side each goes as if it
/// were alone.
template <class M>
class Extrapolation {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  explicit Extrapolation(std::size_t speeds) : last_(speeds) {
    for (Speeds<M>& row : differences_) row = Speeds<M>(speeds);
  }

  /// Some instances begin anew.
  void forget(Mask which) {
    for (Speeds<M>& row : differences_)
      for (Real& difference : row) Instances::take(which, Real(0), difference);
    Instances::take(which, Real(1), h_);
  }

  /// The accelerations at the start of a step of length h become those that are expected at its end.
  void expect(Speeds<M>& vdot, Real h, std::span<const double> nominals) {
    extrapolate_from(vdot, h);
    Real size = largest(differences_[0], nominals);
    Mask falling = Instances::all_if(true);
    for (std::size_t k = 0; k + 1 < differences_.size(); ++k) {
      const Real next = largest(differences_[k + 1], nominals);
      falling = Instances::both(falling, next < size);
      if (!Instances::any(falling)) break;
      for (std::size_t i = 0; i < vdot.size(); ++i) Instances::take(falling, vdot[i] + differences_[k][i], vdot[i]);
      size = next;
    }
  }

  /// A step of some instances has ended with these accelerations.
  void keep(const Speeds<M>& vdot, Mask which) {
    for (std::size_t i = 0; i < vdot.size(); ++i) {
      Real difference = vdot[i] - last_[i];
      for (Speeds<M>& row : differences_) {
        const Real next = difference - row[i];
        Instances::take(which, difference, row[i]);
        difference = next;
      }
    }
  }

  /// Memory of one instance, in lane k of this, from or to that of it alone.
  template <class One>
  void put_lane(int k, const One& one) {
    copy(one, [k](const auto& from, Real& to) { to.v[k] = from; });
  }
  template <class One>
  void read_lane(int k, One& one) const {
    one.copy(*this, [k](Real from, auto& to) { to = from[k]; });
  }

 private:
  template <class>
  friend class Extrapolation;

  template <class Other, class Copy>
  void copy(const Other& other, Copy copy) {
    for (std::size_t k = 0; k < differences_.size(); ++k)
      for (std::size_t i = 0; i < last_.size(); ++i) copy(other.differences_[k][i], differences_[k][i]);
    copy(other.h_, h_);
  }

  /// A jump of the accelerations between steps shifts the polynomial; another length of steps scales its differences.
  void extrapolate_from(const Speeds<M>& vdot, Real h) {
    last_ = vdot;
    const Mask all = Instances::all_if(true), other = Instances::without(all, Instances::both(h <= h_, h_ <= h));
    if (!Instances::any(other)) return;
    const Real ratio = h / h_;
    Real factor(1);
    for (Speeds<M>& row : differences_) {
      Instances::take(other, factor * ratio, factor);
      for (Real& difference : row) Instances::take(other, factor * difference, difference);
    }
    h_ = h;
  }

  std::array<Speeds<M>, 4> differences_;  ///< of orders 1 to 4
  Speeds<M> last_;                        ///< at the start of the present step
  Real h_{1};                             ///< the length of the last one
};

}  // namespace cutjoint
