// Guides whose rates jump: the impulses of guides and loops at that instant.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/dense.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// A mechanism or system as an impulse meets it: masses, the equations of loops, and the momentum of what is guided.
///
/// All come from functions that it has anyway.  In relative coordinates T = 1/2 v^T M v + v^T p + T_0 with the momentum p that guides give to the free
/// coordinates, so that differences of T are M and p without an error; a system has M in its residual.  Natural coordinates have guides among their equations,
/// and p = 0.
template <class Subject>
class Struck {
 public:
  using Real = typename Subject::real_type;
  using Vector = std::vector<Real>;

  static constexpr bool is_system = requires(Subject& s, const Real* in, Real* out) { s.apply_jacobian(in, in, out); };

  explicit Struck(Subject& subject)
      : subject_(subject), n_(speeds_of(subject.description()).size()), m_(subject.description().equations.size()), relative_(has_charts(subject)),
        v_(n_), still_(n_), none_(m_), gap_(m_), rest_(m_), force_(n_), weight_(n_) {}

  std::size_t speeds() const { return n_; }
  std::size_t equations() const { return m_; }

  void take_memory() { masses_.resize(n_ * n_); }

  /// Go to a pose; `masses` then are those of the free coordinates, without guides.
  void take_masses(const Vector& q, Real t) {
    subject_.begin_step(t, Real(0));
    if constexpr (is_system) masses_of_system(q);
    else masses_of_mechanism(q);
  }

  Real mass(std::size_t i, std::size_t j) const { return masses_[j * n_ + i]; }

  /// A column of Phi_v, with m elements, in the pose and at the time where masses were taken.
  void jacobian(const Vector& q, std::size_t j, Real* column) {
    v_.assign(n_, Real(0));
    v_[j] = Real(1);
    if constexpr (is_system) subject_.apply_jacobian(q.data(), v_.data(), column);
    else subject_.constraint_residual(q.data(), v_.data(), rest_.data(), column);
  }

  /// p at a time, with the guides' rates there.
  void momentum(const Vector& q, Real t, Vector& p) {
    p.assign(n_, Real(0));
    if (!relative_) return;
    subject_.begin_step(t, Real(1));
    v_.assign(n_, Real(0));
    for (std::size_t i = 0; i < n_; ++i) {
      v_[i] = Real(1);
      const Real forth = energy(q, v_);
      v_[i] = Real(-1);
      p[i] = (forth - energy(q, v_)) / 2;
      v_[i] = Real(0);
    }
  }

  /// The gaps of the equations at the last time.
  const Vector& gaps(const Vector& q) {
    if constexpr (is_system) subject_.constraint_residual(q.data(), still_.data(), still_.data(), rest_.data(), gap_.data(), none_.data());
    else subject_.constraint_residual(q.data(), still_.data(), rest_.data(), gap_.data());
    return rest_;
  }

  /// Kinetic energy of relative coordinates at a time, with guides held still.
  Real kinetic_beside_guides(const Vector& q, const Vector& v, Real t) {
    subject_.begin_step(t, Real(0));
    return relative_ ? energy(q, v) : Real(0);
  }

  /// The rates of the equations at a time.
  const Vector& rates(const Vector& q, const Vector& v, Real t) {
    subject_.begin_step(t, Real(1));
    if constexpr (is_system) subject_.constraint_residual(q.data(), v.data(), still_.data(), rest_.data(), gap_.data(), none_.data());
    else subject_.constraint_residual(q.data(), v.data(), rest_.data(), gap_.data());
    return gap_;
  }

  /// Kinetic energy at a time; of natural coordinates by the masses that were taken.
  Real kinetic(const Vector& q, const Vector& v, Real t) {
    if (relative_) {
      subject_.begin_step(t, Real(1));
      return energy(q, v);
    }
    Real twice(0);
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t i = 0; i < n_; ++i) twice += v[i] * mass(i, j) * v[j];
    return twice / 2;
  }

  bool is_relative() const { return relative_; }

 private:
  static bool has_charts(const Subject& subject) { return !is_system || !subject.description().charts.empty(); }

  /// Kinetic energy; nobody asks a generic system, which is not relative and has none.
  Real energy(const Vector& q, const Vector& v) {
    Real energy[2] = {};
    if constexpr (requires { subject_.energy(q.data(), v.data(), still_.data(), zero(), energy); })
      subject_.energy(q.data(), v.data(), still_.data(), zero(), energy);
    return energy[0];
  }

  const Real* zero() {
    none_.assign(m_, Real(0));
    return none_.data();
  }

  void masses_of_mechanism(const Vector& q) {
    v_.assign(n_, Real(0));
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

  /// Accelerations so large that forces beside them cost no digits.
  void masses_of_system(const Vector& q)
    requires is_system
  {
    const Real large(16384);
    v_.assign(n_, Real(0));
    subject_.dynamic_residual(q.data(), still_.data(), v_.data(), zero(), Real(0), weight_.data(), rest_.data());
    for (std::size_t j = 0; j < n_; ++j) {
      v_[j] = large;
      subject_.dynamic_residual(q.data(), still_.data(), v_.data(), zero(), Real(0), force_.data(), rest_.data());
      for (std::size_t i = 0; i < n_; ++i) masses_[j * n_ + i] = (force_[i] - weight_[i]) / large;
      v_[j] = Real(0);
    }
  }

  Subject& subject_;
  std::size_t n_, m_;
  bool relative_;
  Vector v_, still_, none_, gap_, rest_, force_, weight_, masses_;
};

/// The instants of a run at which guides' rates jump.
///
///     M (v+ - v-) + p+ - p- + Phi_v^T mu = 0        Phid(v+) = 0
///
/// Loops that are closed do no work, so that the guides' is that of the kinetic energy, T+ - T-; what loops that stand open take or give, mu . Phid, is
/// not theirs.
template <class Subject>
class Impacts {
 public:
  using Real = typename Subject::real_type;
  using Vector = std::vector<Real>;

  /// Of a run up to `end`.  All memory is taken here, but for the list of what is found.
  Impacts(Subject& subject, double end)
      : subject_(subject), struck_(subject), width_(std::max(Real(1e-11), 64 * epsilon()) * Real(end)), probe_(struck_.speeds()), still_(struck_.speeds()) {
    for (std::size_t i = 0; i < probe_.size(); ++i) probe_[i] = Real(1) + Real(static_cast<int>(i * 7 % 11)) / 13;
    if (possible()) take_memory();
  }

  /// Whether guides can have a jump.
  bool possible() const { return subject_.description().driven; }

  /// How long before an event that has been located its guides certainly follow the formula before.
  Real width() const { return width_; }

  /// The change of a rate beside one of 1 that is no jump.
  static Real share() { return std::max(Real(1e-9), 1024 * epsilon()); }

  /// Whether guides' rates in a pose are others at two times next to each other, and their places are not.
  bool jumps(const Vector& q, Real before, Real after) { return rates_jump(q, before, after) && !places_jump(q, before, after); }

  /// The speeds of a state before a jump become those after it, and its time is `after`.  Keeps the impact, and returns the guides' work (J).
  Real strike(State<Real>& state, Real after, std::string_view element) {
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
    const Vector& left = struck_.rates(state.q, state.v, after);
    Real work = struck_.kinetic(state.q, state.v, after) - kinetic;
    for (std::size_t i = 0; i < m; ++i) work += step_[n + i] * (before_[i] + left[i]) / 2;
    state.t = after;
    found_.push_back({static_cast<double>(after), static_cast<double>(work), std::string(element)});
    return work;
  }

  /// Adds the impacts to a run's summary.
  void summarise(Json& summary) const {
    if (found_.empty()) return;
    Json list = Json::array();
    for (const Found& each : found_) list.push_back({{"time", each.time}, {"element", each.element}, {"work", number_or_null(each.work)}});
    summary["impacts"] = std::move(list);
  }

 private:
  struct Found {
    double time, work;
    std::string element;
  };

  /// A jump is more than what guides' accelerations change in as long a time beside it.
  void take_memory() {
    const std::size_t n = struck_.speeds(), m = struck_.equations(), size = n + m;
    struck_.take_memory();
    for (Vector* each : {&rates_, &before_}) each->resize(m);
    for (Vector* each : {&momentum_, &change_}) each->resize(n);
    for (Vector* each : {&scale_, &right_, &step_, &left_, &beside_, &room_}) each->resize(size);
    matrix_.resize(size * size);
    order_.resize(size);
  }

  bool rates_jump(const Vector& q, Real before, Real after) {
    const Real change = change_of_rates(q, before, after), length = after - before;
    return change > share() && change > 4 * std::max(change_of_rates(q, before - length, before), change_of_rates(q, after, after + length));
  }

  /// The largest change of what guides' rates change, each beside its size.
  Real change_of_rates(const Vector& q, Real before, Real after) {
    using std::abs;
    Real most(0);
    if (struck_.is_relative()) {
      const Real one = struck_.kinetic(q, probe_, before), other = struck_.kinetic(q, probe_, after);
      const Real guided = struck_.kinetic(q, still_, before), then = struck_.kinetic(q, still_, after);
      if (one > Real(0)) most = std::max(abs(one - other) / one, abs(guided - then) / (guided + then + share() * one));
    }
    rates_ = struck_.rates(q, still_, before);
    const Vector& now = struck_.rates(q, still_, after);
    for (std::size_t i = 0; i < now.size(); ++i) most = std::max(most, abs(now[i] - rates_[i]) / (Real(1) + abs(now[i])));
    return most;
  }

  /// What another place of a guide changes: gaps of the equations, and masses as the free coordinates meet them.
  bool places_jump(const Vector& q, Real before, Real after) {
    using std::abs;
    const Real one = struck_.kinetic_beside_guides(q, probe_, before);
    rates_ = struck_.gaps(q);
    if (abs(one - struck_.kinetic_beside_guides(q, probe_, after)) > share() * one) return true;
    const Vector& now = struck_.gaps(q);
    for (std::size_t i = 0; i < now.size(); ++i)
      if (abs(now[i] - rates_[i]) > share() * (Real(1) + abs(now[i]))) return true;
    return false;
  }

  static constexpr Real epsilon() { return std::numeric_limits<Real>::epsilon(); }

  /// The change of the speeds, then mu, by least squares of least norm, with masses and rows of the equations scaled to one.
  void solve(const Vector& q, Real t) {
    using std::sqrt;
    const std::size_t n = struck_.speeds(), m = struck_.equations(), size = n + m;
    matrix_.assign(size * size, Real(0)), scale_.assign(size, Real(1));
    const dense::Matrix<Real> A{matrix_.data(), size, size};
    subject_.begin_step(t, Real(0));
    for (std::size_t j = 0; j < n; ++j) {
      if (const Real own = struck_.mass(j, j); own > Real(0)) scale_[j] = 1 / sqrt(own);
      for (std::size_t i = 0; i < n; ++i) A(i, j) = struck_.mass(i, j);
      struck_.jacobian(q, j, A.column(j) + n);
    }
    for (std::size_t i = n; i < size; ++i) {
      Real square(0);
      for (std::size_t j = 0; j < n; ++j) square += A(i, j) * scale_[j] * A(i, j) * scale_[j];
      if (square > Real(0)) scale_[i] = 1 / sqrt(square);
      for (std::size_t j = 0; j < n; ++j) A(j, i) = A(i, j);
    }
    for (std::size_t j = 0; j < size; ++j)
      for (std::size_t i = 0; i < size; ++i) A(i, j) *= scale_[i] * scale_[j];
    for (std::size_t i = 0; i < size; ++i) right_[i] = -scale_[i] * (i < n ? change_[i] : rates_[i - n]);
    dense::LeastSquares<Real> squares(A, order_.data(), left_.data(), beside_.data());
    squares.decompose(std::max(Real(1e-10), 1024 * epsilon()));
    squares.solve(right_.data(), step_.data(), room_.data());
    for (std::size_t i = 0; i < size; ++i) step_[i] *= scale_[i];
  }

  Subject& subject_;
  Struck<Subject> struck_;
  Real width_;
  Vector probe_, still_, rates_, before_, momentum_, change_, matrix_, scale_, right_, step_, left_, beside_, room_;
  std::vector<std::size_t> order_;
  std::vector<Found> found_;
};

}  // namespace cutjoint
