// Jumps of guides' rates: the impulses of guides and loops at that instant.
#pragma once

#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

/// A mechanism or system under impulses: masses, the equations of loops, and the momentum of guided bodies.
///
/// In relative coordinates T = 1/2 v^T M v + v^T p + T_0, where guides give the momentum p to the
/// free coordinates.  Differences of T yield M and p exactly.  A system has M in its residual.  Natural coordinates have guides
/// among their equations, and p = 0.
template <class S>
class Struck {
  static constexpr std::size_t unknowns = static_sizes<S>().speeds;

 public:
  using Real = typename S::real_type;

  static constexpr bool is_system = requires(S& s, const Real* in, Real* out) { s.apply_jacobian(in, in, out); };

  /// Memory for `n` velocities and `m` equations, those of the subject or none.
  Struck(S& subject, std::size_t n, std::size_t m)
      : subject_(subject), n_(n), m_(m), relative_(!is_system || !charts_of(subject).empty()), v_(n), still_(n), force_(n), weight_(n), none_(m), violation_(m),
        rest_(m), masses_(n * n) {}

  std::size_t speeds() const { return n_; }
  std::size_t equations() const { return m_; }
  bool is_relative() const { return relative_; }

  /// Go to a pose; `masses` then are those of the free coordinates, without guides.
  void take_masses(const Coordinates<S>& q, Real t) {
    subject_.begin_step(t, Real(0));
    if constexpr (is_system) masses_of_system(q);
    else masses_of_mechanism(q);
  }

  Real mass(std::size_t i, std::size_t j) const { return masses_[j * n_ + i]; }

  /// A column of Phi_v, with m elements, in the pose and at the time of the masses.
  void jacobian(const Coordinates<S>& q, std::size_t j, Real* column) {
    rest();
    v_[j] = Real(1);
    if constexpr (is_system) subject_.apply_jacobian(q.data(), v_.data(), column);
    else subject_.constraint_residual(q.data(), v_.data(), rest_.data(), column);
  }

  /// p at a time, with the guides' rates there.
  void momentum(const Coordinates<S>& q, Real t, Speeds<S>& p) {
    std::fill(p.begin(), p.end(), Real(0));
    if (!relative_) return;
    subject_.begin_step(t, Real(1));
    rest();
    for (std::size_t i = 0; i < n_; ++i) {
      v_[i] = Real(1);
      const Real forth = energy(q, v_);
      v_[i] = Real(-1);
      p[i] = (forth - energy(q, v_)) / 2;
      v_[i] = Real(0);
    }
  }

  /// The violations of the equations at the last time.
  const Equations<S>& violations(const Coordinates<S>& q) {
    find_residual(q, still_);
    return rest_;
  }

  /// The rates of the equations at a time.
  const Equations<S>& rates(const Coordinates<S>& q, const Speeds<S>& v, Real t) {
    subject_.begin_step(t, Real(1));
    find_residual(q, v);
    return violation_;
  }

  /// Kinetic energy of relative coordinates at a time, with guides at rest.
  Real kinetic_beside_guides(const Coordinates<S>& q, const Speeds<S>& v, Real t) {
    subject_.begin_step(t, Real(0));
    return relative_ ? energy(q, v) : Real(0);
  }

  /// Kinetic energy at a time; in natural coordinates by the stored masses.
  Real kinetic(const Coordinates<S>& q, const Speeds<S>& v, Real t) {
    if (relative_) {
      subject_.begin_step(t, Real(1));
      return energy(q, v);
    }
    Real twice(0);
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t i = 0; i < n_; ++i) twice += v[i] * mass(i, j) * v[j];
    return twice / 2;
  }

 private:
  void rest() { std::fill(v_.begin(), v_.end(), Real(0)); }

  void find_residual(const Coordinates<S>& q, const Speeds<S>& v) {
    if constexpr (is_system) subject_.constraint_residual(q.data(), v.data(), still_.data(), rest_.data(), violation_.data(), none_.data());
    else subject_.constraint_residual(q.data(), v.data(), rest_.data(), violation_.data());
  }

  /// Kinetic energy; not called for a system in natural coordinates, which may have none.
  Real energy(const Coordinates<S>& q, const Speeds<S>& v) {
    Real energy[2] = {};
    if constexpr (requires { subject_.energy(q.data(), v.data(), v.data(), zero(), energy); })
      subject_.energy(q.data(), v.data(), v.data(), zero(), energy);
    return energy[0];
  }

  const Real* zero() {
    std::fill(none_.begin(), none_.end(), Real(0));
    return none_.data();
  }

  void masses_of_mechanism(const Coordinates<S>& q) {
    rest();
    for (std::size_t i = 0; i < n_; ++i) {
      v_[i] = Real(1);
      weight_[i] = energy(q, v_);
      for (std::size_t j = 0; j < i; ++j) {
        v_[j] = Real(1);
        masses_[j * n_ + i] = masses_[i * n_ + j] = energy(q, v_) - weight_[i] - weight_[j];
        v_[j] = Real(0);
      }
      masses_[i * n_ + i] = 2 * weight_[i];
      v_[i] = Real(0);
    }
  }

  /// Accelerations so large that forces are below rounding.
  void masses_of_system(const Coordinates<S>& q) requires is_system {
    const Real large(16384);
    rest();
    subject_.dynamic_residual(q.data(), still_.data(), v_.data(), zero(), Real(0), weight_.data(), rest_.data());
    for (std::size_t j = 0; j < n_; ++j) {
      v_[j] = large;
      subject_.dynamic_residual(q.data(), still_.data(), v_.data(), zero(), Real(0), force_.data(), rest_.data());
      for (std::size_t i = 0; i < n_; ++i) masses_[j * n_ + i] = (force_[i] - weight_[i]) / large;
      v_[j] = Real(0);
    }
  }

  S& subject_;
  std::size_t n_, m_;
  bool relative_;
  Speeds<S> v_, still_, force_, weight_;
  Equations<S> none_, violation_, rest_;
  Array<S, unknowns * unknowns> masses_;
};

/// Replaces `Impacts` if no guide's rate can jump: empty memory.
struct NoImpacts {
  template <class... Any>
  explicit NoImpacts(Any&&...) {}

  struct Memory {};
  static Memory memory() { return {}; }
  static void restore(Memory) {}
};

/// No observer.
struct UnwatchedImpacts {
  static void reach(const auto&) {}
  static void leave(const auto&, const auto&, std::size_t) {}
};

/// An observer set at run time.
template <class S>
struct CalledImpacts {
  using Real = typename S::real_type;

  void (*reached)(void* who, StateOf<S>& state) = nullptr;
  void (*left)(void* who, const StateOf<S>& state, Real work, std::size_t which) = nullptr;
  void* who = nullptr;

  void reach(StateOf<S>& state) const {
    if (reached) reached(who, state);
  }
  void leave(const StateOf<S>& state, Real work, std::size_t which) const {
    if (left) left(who, state, work, which);
  }
};

/// The observer of a simulation's impacts; none for classes with known sizes.
template <class S>
using ImpactWatch = std::conditional_t<Sized<S>, UnwatchedImpacts, CalledImpacts<S>>;

/// The instants at which guides' rates jump.
///
///     M (v+ - v-) + p+ - p- + Phi_v^T mu = 0        Phid(v+) = 0
///
/// Closed loops do no work, so the guides' work is the change of the kinetic energy, T+ - T-.  The work of open loops, mu . Phid, is
/// excluded.  An observer receives the state before an impact (`reach`), then that after it (`leave`) with the guides' work (J) and the indicator.
template <class S>
class Impacts {
  static constexpr Sizes sizes = static_sizes<S>();
  static constexpr std::size_t unknowns = sizes.speeds + sizes.equations;

 public:
  using Real = typename S::real_type;

  /// For a run up to `end`.  All memory is allocated here if guides may jump.
  Impacts(S& subject, double end) : Impacts(subject, end, may_jump(subject) ? sizes_of(subject) : Sizes{}) {}

  /// Whether guides' rates may jump.
  bool possible() const { return may_jump(subject_); }

  /// A time before a located event by which its guides certainly follow the previous formula.
  Real width(Real t) const {
    using std::abs;
    return std::max(Real(1e-11), 64 * epsilon()) * std::max(end_, abs(t));
  }

  /// The relative change of a rate below which it is no jump.
  static Real share() { return std::max(Real(1e-9), 1024 * epsilon()); }

  /// Whether guides' rates jump between two adjacent times while their positions do not.
  bool jumps(const Coordinates<S>& q, Real before, Real after) { return rates_jump(q, before, after) && !places_jump(q, before, after); }

  /// Apply the jump to the velocities of a state, and set its time to `after`.  Returns the guides' work (J).
  Real strike(StateOf<S>& state, Real after) {
    const std::size_t n = struck_.speeds(), m = struck_.equations();
    struck_.momentum(state.q, state.t, momentum_);
    struck_.momentum(state.q, after, change_);
    for (std::size_t i = 0; i < n; ++i) change_[i] -= momentum_[i];
    struck_.take_masses(state.q, after);
    const Real kinetic = struck_.kinetic(state.q, state.v, state.t);
    before_ = struck_.rates(state.q, state.v, state.t);
    rates_ = struck_.rates(state.q, state.v, after);
    solve(state.q, after);
    for (std::size_t i = 0; i < n; ++i) state.v[i] += step_[i];
    const Equations<S>& left = struck_.rates(state.q, state.v, after);
    Real work = struck_.kinetic(state.q, state.v, after) - kinetic;
    for (std::size_t i = 0; i < m; ++i) work += step_[n + i] * (before_[i] + left[i]) / 2;
    state.t = after;
    return work;
  }

  /// A step of a scheme (stepping/stepper.hpp) has ended at an event, `since` the previous one: apply impulses if guides' rates jump there.
  void meet(auto& scheme, std::size_t which, Real since, auto watch) {
    if (!possible()) return;
    const Real after = scheme.time(), before = std::max(after - width(after), since);
    std::copy_n(scheme.pose(), state_.q.size(), state_.q.begin());
    if (!jumps(state_.q, before, after)) return;
    scheme.read_struck(before, state_);
    watch.reach(state_);
    const Real work = strike(state_, after);
    watch.leave(state_, work, which);
    scheme.take_speeds(state_.v);
  }

 private:
  Impacts(S& subject, double end, const Sizes& own)
      : subject_(subject), struck_(subject, own.speeds, own.equations), state_(own.coordinates, own.speeds, own.equations), end_(end), probe_(own.speeds),
        still_(own.speeds), momentum_(own.speeds), change_(own.speeds), rates_(own.equations), before_(own.equations), scale_(own.speeds + own.equations),
        right_(scale_), step_(scale_), left_(scale_), beside_(scale_), room_(scale_), matrix_(scale_.size() * scale_.size()), order_(scale_.size()) {
    for (std::size_t i = 0; i < probe_.size(); ++i) probe_[i] = Real(1) + Real(static_cast<int>(i * 7 % 11)) / 13;
  }

  /// A jump exceeds the change by guides' accelerations in an equal time beside it.
  bool rates_jump(const Coordinates<S>& q, Real before, Real after) {
    const Real change = change_of_rates(q, before, after), length = after - before;
    return change > share() && change > 4 * std::max(change_of_rates(q, before - length, before), change_of_rates(q, after, after + length));
  }

  /// The largest relative change of quantities that guides' rates change.
  Real change_of_rates(const Coordinates<S>& q, Real before, Real after) {
    using std::abs;
    Real largest(0);
    if (struck_.is_relative()) {
      const Real one = struck_.kinetic(q, probe_, before), other = struck_.kinetic(q, probe_, after);
      const Real guided = struck_.kinetic(q, still_, before), then = struck_.kinetic(q, still_, after);
      if (one > Real(0)) largest = std::max(abs(one - other) / one, abs(guided - then) / (guided + then + share() * one));
    }
    rates_ = struck_.rates(q, still_, before);
    const Equations<S>& now = struck_.rates(q, still_, after);
    for (std::size_t i = 0; i < now.size(); ++i) largest = std::max(largest, abs(now[i] - rates_[i]) / (Real(std::sqrt(arm_of(subject_))) + abs(now[i])));
    return largest;
  }

  /// Whether a guide's position changes the mechanism: violations of the equations, and masses of the free coordinates.
  bool places_jump(const Coordinates<S>& q, Real before, Real after) {
    using std::abs;
    const Real one = struck_.kinetic_beside_guides(q, probe_, before);
    rates_ = struck_.violations(q);
    if (abs(one - struck_.kinetic_beside_guides(q, probe_, after)) > share() * one) return true;
    const Equations<S>& now = struck_.violations(q);
    for (std::size_t i = 0; i < now.size(); ++i)
      if (abs(now[i] - rates_[i]) > share() * (Real(arm_of(subject_)) + abs(now[i]))) return true;
    return false;
  }

  static constexpr Real epsilon() { return std::numeric_limits<Real>::epsilon(); }

  /// The change of the velocities, then mu, by minimum-norm least squares, with masses and rows of the equations scaled to one.  A row below 1e-7 of the
  /// largest, relative to the masses, is not scaled up: a row that is zero up to rounding would constrain a random direction.
  void solve(const Coordinates<S>& q, Real t) {
    using std::sqrt;
    const std::size_t n = struck_.speeds(), m = struck_.equations(), size = n + m;
    std::fill(matrix_.begin(), matrix_.end(), Real(0)), std::fill(scale_.begin(), scale_.end(), Real(1));
    const dense::Matrix<Real> A{matrix_.data(), size, size};
    subject_.begin_step(t, Real(0));
    for (std::size_t j = 0; j < n; ++j) {
      if (const Real own = struck_.mass(j, j); own > Real(0)) scale_[j] = 1 / sqrt(own);
      for (std::size_t i = 0; i < n; ++i) A(i, j) = struck_.mass(i, j);
      struck_.jacobian(q, j, A.column(j) + n);
    }
    Real longest(0);
    for (std::size_t i = n; i < size; ++i) {
      for (std::size_t j = 0; j < n; ++j) A(j, i) = A(i, j), right_[j] = A(i, j) * scale_[j];
      const std::span<const Real> row(right_.data(), n);
      scale_[i] = sqrt(dot(row, row)), longest = std::max(longest, scale_[i]);
    }
    for (std::size_t i = n; i < size && longest > Real(0); ++i) scale_[i] = 1 / std::max(scale_[i], Real(1e-7) * longest);
    for (std::size_t j = 0; j < size; ++j)
      for (std::size_t i = 0; i < size; ++i) A(i, j) *= scale_[i] * scale_[j];
    for (std::size_t i = 0; i < size; ++i) right_[i] = -scale_[i] * (i < n ? change_[i] : rates_[i - n]);
    dense::LeastSquares<Real> squares(A, order_.data(), left_.data(), beside_.data());
    squares.decompose(std::max(Real(1e-10), 1024 * epsilon()));
    squares.solve(right_.data(), step_.data(), room_.data());
    for (std::size_t i = 0; i < size; ++i) step_[i] *= scale_[i];
  }

  S& subject_;
  Struck<S> struck_;
  StateOf<S> state_;
  Real end_;
  Speeds<S> probe_, still_, momentum_, change_;
  Equations<S> rates_, before_;
  Array<S, unknowns> scale_, right_, step_, left_, beside_, room_;
  Array<S, unknowns * unknowns> matrix_;
  Array<S, unknowns, std::size_t> order_;
};

}  // namespace cutjoint
