// Equations of motion in independent coordinates, and Jacobians of points of bodies with respect to their rates.
#pragma once

#include "cutjoint/core/simulation/checked_minimal.hpp"
#include "cutjoint/core/mechanism/poses.hpp"

namespace cutjoint {

/// A checked simulation with minimal coordinates and `count` poses, with its mass matrix, its force and Jacobians of points.
template <class Base, std::size_t count>
class WithDynamics : public Base {
 public:
  /// M and f of M z'' = f, each unless it is a null pointer.
  static int equations_of_motion(WithDynamics* s, double* mass, double* force) {
    if (const int status = Base::ask(s)) return status;
    std::array<double, states + 1> rates;
    std::array<double, f * f + 1> M;
    s->minimal.derive(s->sim.present_state(), rates.data());
    if (const Fault fault = s->find_mass(M.data())) return Base::status_of(s, fault);
    if (mass) std::copy_n(M.begin(), f * f, mass);
    for (std::size_t i = 0; force && i < f; ++i) {
      force[i] = 0.0;
      for (std::size_t j = 0; j < f; ++j) force[i] += M[i * f + j] * rates[f + j];
    }
    return call_ok;
  }

  /// Jacobian (6, degrees of freedom), by rows, of the velocity of a point, given in the design position, and of its body's angular velocity.
  static int point_jacobian(WithDynamics* s, int index, const double* point, double* jacobian) {
    if (const int status = Base::ask(s)) return status;
    if (index < 0 || static_cast<std::size_t>(index) >= count) return no_such_index;
    if (!point || (f > 0 && !jacobian)) return no_array;
    if (!all_finite(point, 3)) return not_finite;
    return Base::status_of(s, s->with_directions([&](const double* directions) {
      std::array<double, numbers_per_pose * count> numbers;
      for (std::size_t k = 0; k < f; ++k) {
        s->sim.mechanism().poses(s->sim.state().q.data(), directions + k * n, numbers.data());
        put(numbers.data() + numbers_per_pose * static_cast<std::size_t>(index), point, jacobian + k);
      }
    }));
  }

 private:
  static constexpr std::size_t f = Base::dofs, states = Base::states, n = Base::all_speeds;

  /// Velocities for unit rates of independent coordinates, column by column, with guides at rest.
  Fault with_directions(auto use) {
    std::array<double, n * f + 1> columns;
    const Fault fault = this->minimal.directions(this->sim.starter(), this->sim.state(), columns.data());
    if (fault) return fault;
    this->sim.mechanism().begin_step(this->sim.state().t, 0.0);
    use(columns.data());
    this->sim.starter();  // guides move again
    return {};
  }

  /// The mass matrix by the kinetic energy, T(a + b) - T(a) - T(b) = a^T M b.
  Fault find_mass(double* M) {
    return with_directions([&](const double* directions) {
      const auto& state = this->sim.state();
      std::array<double, n + 1> both{};
      const auto energy = [&](const double* v) {
        double found[2]{};
        this->sim.mechanism().energy(state.q.data(), v, v, state.lambda.data(), found);
        return found[0];
      };
      for (std::size_t i = 0; i < f; ++i) M[i * f + i] = 2.0 * energy(directions + i * n);
      for (std::size_t i = 0; i < f; ++i)
        for (std::size_t j = 0; j < i; ++j) {
          for (std::size_t k = 0; k < n; ++k) both[k] = directions[i * n + k] + directions[j * n + k];
          M[i * f + j] = M[j * f + i] = energy(both.data()) - 0.5 * (M[i * f + i] + M[j * f + j]);
        }
    });
  }

  /// A column from a pose that moves.
  static void put(const double* pose, const double* point, double* column) {
    const double *R = pose + 3, *velocity = pose + 12, *spin = pose + 15, *origin = pose + 18;
    double arm[3]{};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) arm[i] += R[3 * j + i] * (point[j] - origin[j]);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      column[i * f] = velocity[i] + (spin[j] * arm[k] - spin[k] * arm[j]);
      column[(3 + i) * f] = spin[i];
    }
  }
};

}  // namespace cutjoint
