// The constraint equations: products of forms, turns by an angle, elements of forms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/natural/forms.hpp"
#include "cutjoint/generic/natural/places.hpp"

namespace cutjoint::generic::natural {

enum class RowKind {
  product,    ///< the sum of weight (u . w) over up to two pairs of forms, - value - course - factor angle of up to two angles
  turned,     ///< f . (b_2 cos angle - b_1 sin angle), the angle a coordinate or a course
  component,  ///< an element of a form
  angle       ///< an angle less its course
};

/// The equations Phi(q, t) = 0 with Phi_q by scalar coordinates: of each row a fixed list of these, ascending.
template <class Real>
class Rows {
 public:
  Rows(const Json& equations, Expressions<Real>& e, const Forms<Real>& forms) : forms_(forms) {
    for (const Json& json : equations) read(json, e);
    phi_.resize(rows_.size());
    gradient_.resize(columns_.size());
    state_.resize(rows_.size());
  }

  std::size_t size() const { return rows_.size(); }

  void load(const Expressions<Real>& e) {
    for (Row& row : rows_) {
      for (std::size_t pair = 0; pair < 2; ++pair) row.weight_values[pair] = e[row.weights[pair]];
      row.constant = e[row.value];
      for (AngleTerm& term : row.angles) term.factor_value = e[term.factor];
      for (std::size_t i = row.share; i < row.share + row.shares; ++i) shares_[i].coefficients.fill(Real(0));
      for (int slot = 0; slot < row.slots; ++slot)
        for (const Term<Real>& t : forms_.terms(row.forms[static_cast<std::size_t>(slot)]))
          shares_[find(row, t.at)].coefficients[static_cast<std::size_t>(slot)] = t.coefficient;
      if (row.kind == RowKind::component)
        for (std::size_t i = 0; i < row.shares; ++i) gradient_[row.first + i] = shares_[row.share + i].coefficients[0];
    }
  }

  void begin_step(const Expressions<Real>& e) {
    for (Row& row : rows_)
      if (row.is_guided)
        for (std::size_t i = 0; i < 3; ++i) row.course_value[i] = e[row.course[i]];
  }

  /// Phi and Phi_q.
  void update(const Real* q) {
    for (std::size_t i = 0; i < rows_.size(); ++i) update(i, q);
  }

  Real residual(std::size_t i) const { return phi_[i]; }

  /// Phi_q v + Phi_t.
  Real rate(std::size_t i, const Real* v) const { return along(i, v) + time_rate(rows_[i], state_[i]); }

  /// Phi_q vdot + (d/dt Phi_q) v + (d/dt Phi_t).
  /// Its share of Phi_q x.
  Real directional_derivative(std::size_t i, const Real* x) const { return along(i, x); }

  Real curvature(std::size_t i, const Real* v, const Real* vdot) const { return along(i, vdot) + drift(rows_[i], state_[i], v); }

  /// The derivative by one of the row's forms.
  const Vector3<Real>& by_form(std::size_t i, std::size_t slot) const { return state_[i].by_form[slot]; }

  /// force += Phi_q^T w for one row.
  void add_gradient(std::size_t i, Real w, Real* force) const {
    for (std::size_t k = rows_[i].first; k < rows_[i].last; ++k) force[columns_[k]] += gradient_[k] * w;
  }

  /// The entries of Phi_q^T Phi_q, or of [., Phi_q^T; Phi_q, 0] with the equations from `offset` on.
  void enter(Places& places, bool augmented, int offset) const {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const int row = offset + static_cast<int>(i);
      if (augmented) Scatter::enter(places, columns(i));
      else
        for (const int column : columns(i)) places.add(column, row), places.add(row, column);
    }
  }

  void find_entries(const Pattern& pattern, bool augmented, int offset) {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const auto scalars = columns(i);
      const int row = offset + static_cast<int>(i);
      for (std::size_t c = 0; c < scalars.size(); ++c) {
        if (augmented)
          for (std::size_t r = c; r < scalars.size(); ++r) entries_.push_back(entry_of(pattern, scalars[r], scalars[c]));
        else entries_.push_back(entry_of(pattern, scalars[c], row)), entries_.push_back(entry_of(pattern, row, scalars[c]));
      }
    }
  }

  /// values += weight Phi_q^T Phi_q, the lower triangle.
  void add_squares(Real weight, Real* values) const {
    const int* entry = entries_.data();
    for (const Row& row : rows_) {
      for (std::size_t c = row.first; c < row.last; ++c) {
        const Real weighed = weight * gradient_[c];
        for (std::size_t r = c; r < row.last; ++r) values[*entry++] += weighed * gradient_[r];
      }
    }
  }

  /// values += weight [0, Phi_q^T; Phi_q, 0].
  void add_borders(Real weight, Real* values) const {
    const int* entry = entries_.data();
    for (const Real g : gradient_) {
      values[*entry++] += weight * g;
      values[*entry++] += weight * g;
    }
  }

 private:
  /// A product's angle with its factor.
  struct AngleTerm {
    int at, factor;
    std::size_t column = 0;
    Real factor_value{0};
  };

  /// `angle` is that of a turned direction, or of an angle less its course.
  struct Row {
    RowKind kind;
    std::array<int, 4> forms{-1, -1, -1, -1};
    std::array<int, 2> weights{-1, -1};
    std::vector<AngleTerm> angles{};
    int slots = 0, value = -1, angle = -1, axis = 0;
    bool is_guided = false;
    std::array<int, 3> course{};
    std::size_t first = 0, last = 0;    ///< of its columns
    std::size_t share = 0, shares = 0;  ///< of its coordinates
    std::size_t angle_column = 0;
    std::array<Real, 2> weight_values{};
    Real constant{0};
    std::array<Real, 3> course_value{};
  };

  /// The part of each form of a row in a coordinate of three, whose gradient stands from `column` on.
  struct Share {
    int at;
    std::size_t column;
    std::array<Real, 4> coefficients{};
  };

  struct State {
    std::array<Vector3<Real>, 4> by_form{Vector3<Real>::Zero(), Vector3<Real>::Zero(), Vector3<Real>::Zero(), Vector3<Real>::Zero()};
    Real sin{0}, cos{0};
  };

  std::span<const int> columns(std::size_t i) const { return {columns_.data() + rows_[i].first, rows_[i].last - rows_[i].first}; }

  static RowKind kind_of(const std::string& name) {
    if (name == "product") return RowKind::product;
    if (name == "turned") return RowKind::turned;
    if (name == "component") return RowKind::component;
    if (name == "angle") return RowKind::angle;
    throw std::runtime_error("unknown kind of equation '" + name + "'");
  }

  void read(const Json& json, Expressions<Real>& e) {
    Row row{.kind = kind_of(json.at("kind"))};
    for (const Json& form : json.at("forms")) row.forms.at(static_cast<std::size_t>(row.slots++)) = form;
    const auto number = [&](const char* key) { return e.read(json.contains(key) ? json.at(key) : Json(0.0)); };
    for (std::size_t pair = 0; pair < 2; ++pair) {
      const bool is_given = json.contains("weights") && pair < json.at("weights").size();
      row.weights[pair] = e.read(is_given ? json.at("weights").at(pair) : Json(0.0));
    }
    row.value = number("value");
    row.axis = json.value("axis", 0);
    row.is_guided = json.contains("course");
    for (std::size_t i = 0; row.is_guided && i < 3; ++i) row.course[i] = e.read(json.at("course").at(i));
    if (json.contains("angle")) row.angle = forms_.angle(json.at("angle"));
    for (const Json& term : json.value("angles", Json::array())) row.angles.push_back({forms_.angle(term.at(0)), e.read(term.at(1))});
    enter_coordinates(row);
    rows_.push_back(row);
  }

  /// The row's coordinates, three elements each but for a component's one, and its angles.
  void enter_coordinates(Row& row) {
    std::set<int> coordinates;
    for (int slot = 0; slot < row.slots; ++slot)
      for (const Term<Real>& t : forms_.terms(row.forms[static_cast<std::size_t>(slot)])) coordinates.insert(t.at);
    if (row.angle >= 0) coordinates.insert(row.angle);
    for (const AngleTerm& term : row.angles) coordinates.insert(term.at);
    row.first = columns_.size();
    row.share = shares_.size();
    for (const int at : coordinates) {
      const auto term = std::find_if(row.angles.begin(), row.angles.end(), [at](const AngleTerm& t) { return t.at == at; });
      const bool is_angle = at == row.angle || term != row.angles.end();
      if (at == row.angle) row.angle_column = columns_.size();
      else if (is_angle) term->column = columns_.size();
      else shares_.push_back({at, columns_.size(), {}});
      const bool is_one = row.kind == RowKind::component || is_angle;
      for (int i = 0; i < (is_one ? 1 : 3); ++i) columns_.push_back(at + (is_one ? row.axis : i));
    }
    row.shares = shares_.size() - row.share;
    row.last = columns_.size();
  }

  std::size_t find(const Row& row, int at) const {
    for (std::size_t i = row.share; i < row.share + row.shares; ++i)
      if (shares_[i].at == at) return i;
    throw std::logic_error("a row without a coordinate of its form");
  }

  void update(std::size_t i, const Real* q) {
    using std::cos, std::sin;
    const Row& row = rows_[i];
    State& state = state_[i];
    switch (row.kind) {
      case RowKind::product: {
        phi_[i] = -row.constant - row.course_value[0];
        for (std::size_t slot = 0; slot < static_cast<std::size_t>(row.slots); slot += 2) {
          const Vector3<Real>&u = x(row, slot), &w = x(row, slot + 1);
          const Real weight = row.weight_values[slot / 2];
          state.by_form[slot] = weight * w;
          state.by_form[slot + 1] = weight * u;
          phi_[i] += weight * u.dot(w);
        }
        for (const AngleTerm& term : row.angles) phi_[i] -= term.factor_value * q[term.at], gradient_[term.column] = -term.factor_value;
        break;
      }
      case RowKind::turned: {
        const Real angle = row.angle >= 0 ? q[row.angle] : row.course_value[0];
        state.sin = sin(angle), state.cos = cos(angle);
        state.by_form[0] = state.cos * x(row, 2) - state.sin * x(row, 1);
        state.by_form[1] = -state.sin * x(row, 0);
        state.by_form[2] = state.cos * x(row, 0);
        phi_[i] = x(row, 0).dot(state.by_form[0]);
        if (row.angle >= 0) gradient_[row.angle_column] = -reach(row, state);
        break;
      }
      case RowKind::component:
        phi_[i] = x(row, 0)[row.axis];
        state.by_form[0] = Vector3<Real>::Unit(row.axis);
        return;
      case RowKind::angle:
        phi_[i] = q[row.angle] - row.course_value[0];
        gradient_[row.angle_column] = Real(1);
        return;
    }
    for (std::size_t k = row.share; k < row.share + row.shares; ++k) {
      const Share& share = shares_[k];
      Eigen::Map<Vector3<Real>> g(&gradient_[share.column]);
      g = share.coefficients[0] * state.by_form[0] + share.coefficients[1] * state.by_form[1];
      for (std::size_t slot = 2; slot < static_cast<std::size_t>(row.slots); ++slot) g += share.coefficients[slot] * state.by_form[slot];
    }
  }

  const Vector3<Real>& x(const Row& row, std::size_t slot) const { return forms_.x(row.forms[slot]); }
  const Vector3<Real>& v(const Row& row, std::size_t slot) const { return forms_.v(row.forms[slot]); }

  /// f . (b_1 cos + b_2 sin).
  Real reach(const Row& row, const State& state) const { return x(row, 0).dot(state.cos * x(row, 1) + state.sin * x(row, 2)); }

  Real along(std::size_t i, const Real* v) const {
    Real sum(0);
    for (std::size_t k = rows_[i].first; k < rows_[i].last; ++k) sum += gradient_[k] * v[columns_[k]];
    return sum;
  }

  Real time_rate(const Row& row, const State& state) const {
    if (!row.is_guided) return Real(0);
    return row.kind == RowKind::turned ? -row.course_value[1] * reach(row, state) : -row.course_value[1];
  }

  /// (d/dt Phi_q) v + (d/dt Phi_t).
  Real drift(const Row& row, const State& state, const Real* speed) const {
    switch (row.kind) {
      case RowKind::product: {
        Real bend = -row.course_value[2];
        for (std::size_t slot = 0; slot < static_cast<std::size_t>(row.slots); slot += 2)
          bend += 2 * row.weight_values[slot / 2] * v(row, slot).dot(v(row, slot + 1));
        return bend;
      }
      case RowKind::turned: return turned_drift(row, state, speed);
      case RowKind::component: return Real(0);
      case RowKind::angle: return -row.course_value[2];
    }
    return Real(0);
  }

  /// The direction ahead, b_2 cos - b_1 sin, turns back towards the one across, b_1 cos + b_2 sin.
  Real turned_drift(const Row& row, const State& state, const Real* speed) const {
    const Real rate = row.angle >= 0 ? speed[row.angle] : row.course_value[1], bend = row.course_value[2];
    const Vector3<Real> across = state.cos * x(row, 1) + state.sin * x(row, 2);
    const Vector3<Real> across_rate = state.cos * v(row, 1) + state.sin * v(row, 2);
    const Vector3<Real> ahead_rate = state.cos * v(row, 2) - state.sin * v(row, 1);
    const Real turning = v(row, 0).dot(across) + x(row, 0).dot(across_rate);
    const Real ahead = x(row, 0).dot(state.by_form[0]);
    return 2 * v(row, 0).dot(ahead_rate) - 2 * rate * turning - bend * x(row, 0).dot(across) - rate * rate * ahead;
  }

  const Forms<Real>& forms_;
  std::vector<Row> rows_;
  std::vector<Share> shares_;
  std::vector<State> state_;
  std::vector<int> columns_, entries_;
  std::vector<Real> phi_, gradient_;
};

}  // namespace cutjoint::generic::natural
