#include "point_system.hpp"

#include <cmath>

namespace points {

namespace {

Vector vector_of(const Json& list) { return {list.at(0), list.at(1), list.at(2)}; }

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

End end_of(const Json& end) {
  if (end.is_number()) return {.point = end};
  return {.at = vector_of(end.at("at")), .swing = vector_of(end.value("swing", Json{0, 0, 0})), .rate = end.value("rate", 0.0)};
}

/// The n-th derivative of an end's place by time: of a point from its array, of a pivot from its swing.
Vector place_of(const End& end, const double* values, double t, double motion, int derivative) {
  Vector place{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (end.point >= 0) {
      place[k] = values[3 * end.point + static_cast<int>(k)];
      continue;
    }
    const double phase = end.rate * t;
    const double swing[] = {std::sin(phase), motion * end.rate * std::cos(phase), -motion * end.rate * end.rate * std::sin(phase)};
    place[k] = (derivative == 0 ? end.at[k] : 0.0) + end.swing[k] * swing[derivative];
  }
  return place;
}

Vector operator-(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

}  // namespace

PointSystem::PointSystem(const Json& definition) {
  read(definition);
  name();
  lay_out();
}

void PointSystem::read(const Json& definition) {
  d_.name = "points";
  d_.method = definition.at("method") == "augmented" ? cutjoint::Lagrangian::augmented : cutjoint::Lagrangian::classical;
  for (const Json& point : definition.at("points")) {
    mass_.push_back(point.at("mass"));
    for (const double x : vector_of(point.at("at"))) at_.push_back(x);
    for (const double x : vector_of(point.value("rate", Json{0, 0, 0}))) rate_.push_back(x);
  }
  for (const Json& e : definition.at("equations")) {
    equations_.push_back({.a = end_of(e.at("a")), .b = end_of(e.at("b")), .length = e.value("length", 0.0), .plane = e.contains("normal")});
    if (e.contains("normal")) equations_.back().normal = vector_of(e.at("normal"));
  }
  for (const Json& s : definition.value("springs", Json::array()))
    springs_.push_back({end_of(s.at("a")), end_of(s.at("b")), s.value("stiffness", 0.0), s.value("damping", 0.0), s.value("root", false),
                        s.value("known", true)});
}

/// Names of points p0.x, ... and of equations e0, ...; the columns are places, rates, accelerations and multipliers.
void PointSystem::name() {
  const std::size_t n = at_.size(), m = equations_.size();
  names_.reserve(3 * n + 2 * m);
  const auto keep = [&](std::string text) { return names_.emplace_back(std::move(text)).c_str(); };
  const auto point = [](std::size_t i, const char* rate) { return "p" + std::to_string(i / 3) + "." + rate + "xyz"[i % 3]; };
  std::vector<const char*> coordinates, equations;
  std::vector<cutjoint::Named> columns;
  for (std::size_t i = 0; i < n; ++i) coordinates.push_back(keep(point(i, "")));
  for (std::size_t i = 0; i < m; ++i) equations.push_back(keep("e" + std::to_string(i)));
  for (const char* coordinate : coordinates) columns.push_back({coordinate, "m"});
  for (std::size_t i = 0; i < n; ++i) columns.push_back({keep(point(i, "v")), "m/s"});
  for (std::size_t i = 0; i < n; ++i) columns.push_back({keep(point(i, "a")), "m/s^2"});
  for (std::size_t i = 0; i < m; ++i) columns.push_back({keep("lambda" + std::to_string(i)), "N/m"});
  d_.coordinates = coordinates, d_.equations = equations, d_.columns = columns;
}

/// The places of the tangent's entries: those that linearise fills in one state or another.
void PointSystem::lay_out() {
  const auto n = static_cast<int>(at_.size()), m = static_cast<int>(equations_.size());
  const bool augmented = d_.method == cutjoint::Lagrangian::augmented;
  const int size = d_.pattern.size = augmented ? n : n + m;
  d_.pattern.symmetric = augmented;
  d_.factors = size * size;
  jacobian_.resize(static_cast<std::size_t>(m * n));
  matrix_.assign(static_cast<std::size_t>(size * size), 0.0);
  for (int i = 0; i < n; ++i) dense(i, i) = 1.0;
  const auto couple = [&](const End& a, const End& b, bool all) {
    for (const int p : {a.point, b.point})
      for (const int r : {a.point, b.point})
        for (int k = 0; p >= 0 && r >= 0 && k < 9; ++k)
          if (all || k % 4 == 0) dense(3 * p + k / 3, 3 * r + k % 3) = 1.0;
  };
  for (const Spring& spring : springs_) couple(spring.a, spring.b, false);
  for (int e = 0; e < m; ++e) {
    const Equation& equation = equations_[static_cast<std::size_t>(e)];
    if (augmented) couple(equation.a, equation.b, true);
    for (const int p : {equation.a.point, equation.b.point})
      for (int k = 0; !augmented && p >= 0 && k < 3; ++k) dense(n + e, 3 * p + k) = dense(3 * p + k, n + e) = 1.0;
  }
  std::vector<int> first{0}, rows;
  for (int column = 0; column < size; ++column) {
    for (int row = augmented ? column : 0; row < size; ++row)
      if (dense(row, column) != 0.0) rows.push_back(row);
    first.push_back(static_cast<int>(rows.size()));
  }
  d_.pattern.first = first, d_.pattern.row = rows;
}

void PointSystem::begin_step(double t, double motion) {
  t_ = t;
  motion_ = motion;
}

void PointSystem::initial_coordinates(const double*, const double*, double* q, double* v) const {
  std::copy(at_.begin(), at_.end(), q);
  std::copy(rate_.begin(), rate_.end(), v);
}

void PointSystem::constraint_residual(const double* q, const double* v, const double* vdot, double* residual, double* rate, double* curvature) const {
  for (std::size_t e = 0; e < equations_.size(); ++e) {
    const Equation& x = equations_[e];
    const Vector r = place_of(x.a, q, t_, motion_, 0) - place_of(x.b, q, t_, motion_, 0);
    const Vector rd = place_of(x.a, v, t_, motion_, 1) - place_of(x.b, v, t_, motion_, 1);
    const Vector rdd = place_of(x.a, vdot, t_, motion_, 2) - place_of(x.b, vdot, t_, motion_, 2);
    residual[e] = x.plane ? dot(x.normal, r) - x.length : (dot(r, r) - x.length * x.length) / 2;
    rate[e] = x.plane ? dot(x.normal, rd) : dot(r, rd);
    curvature[e] = x.plane ? dot(x.normal, rdd) : dot(rd, rd) + dot(r, rdd);
  }
}

void PointSystem::differentiate(const Equation& x, const double* q, int index) const {
  const auto n = static_cast<int>(at_.size());
  const Vector r = x.plane ? x.normal : place_of(x.a, q, t_, motion_, 0) - place_of(x.b, q, t_, motion_, 0);
  double* row = jacobian_.data() + index * n;
  std::fill_n(row, n, 0.0);
  for (int k = 0; k < 3; ++k) {
    if (x.a.point >= 0) row[3 * x.a.point + k] += r[static_cast<std::size_t>(k)];
    if (x.b.point >= 0) row[3 * x.b.point + k] -= r[static_cast<std::size_t>(k)];
  }
}

void PointSystem::apply_jacobian_transposed(const double* q, const double* w, double* force) const {
  const auto n = static_cast<int>(at_.size());
  std::fill_n(force, n, 0.0);
  for (int e = 0; e < static_cast<int>(equations_.size()); ++e) {
    differentiate(equations_[static_cast<std::size_t>(e)], q, e);
    for (int i = 0; i < n; ++i) force[i] += jacobian_[static_cast<std::size_t>(e * n + i)] * w[e];
  }
}

void PointSystem::apply_jacobian(const double* q, const double* x, double* change) const {
  const auto n = static_cast<int>(at_.size());
  for (int e = 0; e < static_cast<int>(equations_.size()); ++e) {
    differentiate(equations_[static_cast<std::size_t>(e)], q, e);
    change[e] = 0.0;
    for (int i = 0; i < n; ++i) change[e] += jacobian_[static_cast<std::size_t>(e * n + i)] * x[i];
  }
}

void PointSystem::add_spring(const Spring& s, const double* q, const double* v, double* force_residual) const {
  const Vector r = place_of(s.a, q, t_, motion_, 0) - place_of(s.b, q, t_, motion_, 0);
  const Vector rd = place_of(s.a, v, t_, motion_, 1) - place_of(s.b, v, t_, motion_, 1);
  for (int k = 0; k < 3; ++k) {
    const double tension = s.stiffness * r[static_cast<std::size_t>(k)] + s.damping * rd[static_cast<std::size_t>(k)];
    if (s.a.point >= 0) force_residual[3 * s.a.point + k] += tension;
    if (s.b.point >= 0) force_residual[3 * s.b.point + k] -= tension;
  }
  if (s.root) force_residual[3 * s.a.point + 2] += std::sqrt(q[3 * s.a.point + 2]);
}

void PointSystem::dynamic_residual(const double* q, const double* v, const double* vdot, const double* lambda, double penalty, double* force_residual,
                          double* residual) const {
  const auto n = static_cast<int>(at_.size());
  for (int i = 0; i < n; ++i) {
    const double mass = mass_[static_cast<std::size_t>(i / 3)];
    force_residual[i] = mass * vdot[i] + (i % 3 == 2 ? 9.81 * mass : 0.0);
  }
  for (const Spring& spring : springs_) add_spring(spring, q, v, force_residual);
  for (int e = 0; e < static_cast<int>(equations_.size()); ++e) {
    const Equation& x = equations_[static_cast<std::size_t>(e)];
    const Vector r = place_of(x.a, q, t_, motion_, 0) - place_of(x.b, q, t_, motion_, 0);
    residual[e] = x.plane ? dot(x.normal, r) - x.length : (dot(r, r) - x.length * x.length) / 2;
    differentiate(x, q, e);
    for (int i = 0; i < n; ++i) force_residual[i] += jacobian_[static_cast<std::size_t>(e * n + i)] * (penalty * residual[e] + lambda[e]);
  }
}

void PointSystem::add_tangent(const Spring& s, const double* q, const cutjoint::Weights<double>& weights) const {
  const double stiff = weights.stiffness * s.stiffness + weights.damping * s.damping;
  for (int k = 0; k < 3; ++k) {
    if (s.a.point >= 0) dense(3 * s.a.point + k, 3 * s.a.point + k) += stiff;
    if (s.b.point >= 0) dense(3 * s.b.point + k, 3 * s.b.point + k) += stiff;
    if (s.a.point < 0 || s.b.point < 0) continue;
    dense(3 * s.a.point + k, 3 * s.b.point + k) -= stiff;
    dense(3 * s.b.point + k, 3 * s.a.point + k) -= stiff;
  }
  const int height = 3 * s.a.point + 2;
  if (s.root) dense(height, height) += weights.stiffness / (2 * std::sqrt(q[height]));
}

void PointSystem::linearise(const double* q, const double* v, const double* vdot, const double* lambda, double penalty,
                            const cutjoint::Weights<double>& weights, double* force_residual, double* residual, double* tangent) const {
  const auto n = static_cast<int>(at_.size()), m = static_cast<int>(equations_.size());
  this->dynamic_residual(q, v, vdot, lambda, penalty, force_residual, residual);
  std::fill(matrix_.begin(), matrix_.end(), 0.0);
  for (int i = 0; i < n; ++i) dense(i, i) = mass_[static_cast<std::size_t>(i / 3)];
  for (const Spring& spring : springs_)
    if (spring.known) add_tangent(spring, q, weights);
  for (int e = 0; e < m; ++e) {
    const double* row = jacobian_.data() + e * n;
    for (int i = 0; i < n; ++i) {
      if (d_.method == cutjoint::Lagrangian::classical) dense(i, n + e) = dense(n + e, i) = weights.constraint * row[i];
      else
        for (int j = 0; j < n; ++j) dense(i, j) += weights.constraint * row[i] * row[j];
    }
  }
  for (int column = 0, entry = 0; column < d_.pattern.size; ++column)
    for (; entry < d_.pattern.first[static_cast<std::size_t>(column) + 1]; ++entry)
      tangent[entry] = dense(d_.pattern.row[static_cast<std::size_t>(entry)], column);
}

void PointSystem::report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const {
  for (const double* values : {q, v, vdot}) column = std::copy_n(values, at_.size(), column);
  std::copy_n(lambda, equations_.size(), column);
}

/// L U in the order of the rows: of a symmetric matrix U = D L^T.
int PointSystem::factor(const double* tangent, double* factors) const {
  const int size = d_.pattern.size;
  const auto at = [&](int row, int column) -> double& { return factors[row * size + column]; };
  std::fill_n(factors, size * size, 0.0);
  for (int column = 0, entry = 0; column < size; ++column)
    for (; entry < d_.pattern.first[static_cast<std::size_t>(column) + 1]; ++entry) {
      at(d_.pattern.row[static_cast<std::size_t>(entry)], column) = tangent[entry];
      if (d_.pattern.symmetric) at(column, d_.pattern.row[static_cast<std::size_t>(entry)]) = tangent[entry];
    }
  for (int k = 0; k < size; ++k) {
    const double pivot = at(k, k);
    if (d_.pattern.symmetric ? !(pivot > 0.0) : pivot == 0.0 || !std::isfinite(pivot)) return k;
    for (int i = k + 1; i < size; ++i) {
      at(i, k) /= pivot;
      for (int j = k + 1; j < size; ++j) at(i, j) -= at(i, k) * at(k, j);
    }
  }
  return -1;
}

void PointSystem::solve(const double* factors, double* x) const {
  const int size = d_.pattern.size;
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < i; ++j) x[i] -= factors[i * size + j] * x[j];
  for (int i = size - 1; i >= 0; --i) {
    for (int j = i + 1; j < size; ++j) x[i] -= factors[i * size + j] * x[j];
    x[i] /= factors[i * size + i];
  }
}

}  // namespace points
