// The constant mass matrix and the weight.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "cutjoint/generic/natural/forms.hpp"
#include "cutjoint/generic/natural/places.hpp"

namespace cutjoint::generic::natural {

/// M is a number times the unit matrix for each pair of coordinates.
template <class Real>
class Masses {
 public:
  Masses(const Json& document, Expressions<Real>& e, const Forms<Real>& forms) : forms_(forms) {
    for (const Json& m : document.at("masses")) masses_.push_back({m.at(0), m.at(1), e.read(m.at(2))});
    for (const Json& w : document.at("weights")) weights_.push_back({w.at(0), e.read(w.at(1))});
    for (std::size_t i = 0; i < 3; ++i) gravity_[i] = e.read(document.at("gravity").at(i));
    weight_.assign(document.at("coordinates").size(), Real(0));
    visit([this](int i, int j, Real) { numbers_.try_emplace({i, j}, 0); });
    for (auto& [pair, number] : numbers_) {
      number = entries_.size();
      entries_.push_back({pair.first, pair.second, Real(0)});
    }
  }

  void load(const Expressions<Real>& e) {
    for (Mass& mass : masses_) mass.value = e[mass.number];
    for (Entry& entry : entries_) entry.mass = Real(0);
    visit([this](int i, int j, Real mass) { entries_[numbers_.at({i, j})].mass += mass; });
    const Vector3<Real> gravity(e[gravity_[0]], e[gravity_[1]], e[gravity_[2]]);
    std::fill(weight_.begin(), weight_.end(), Real(0));
    for (const Weight& w : weights_)
      for (const Term<Real>& t : forms_.terms(w.form)) three(weight_.data() + t.at) += e[w.mass] * t.coefficient * gravity;
    for (std::size_t k = 0; k < places_.size(); ++k) base_[places_[k].to] = entries_[places_[k].entry].mass;
  }

  void enter(Places& places) const {
    for (const Entry& entry : entries_)
      for (int i = 0; i < 3; ++i) places.add(entry.row + i, entry.column + i);
  }

  void find_entries(const Pattern& pattern) {
    base_.assign(pattern.row.size(), Real(0));
    for (std::size_t n = 0; n < entries_.size(); ++n)
      for (int i = 0; i < 3; ++i) {
        const int to = entry_of(pattern, entries_[n].row + i, entries_[n].column + i);
        if (to >= 0) places_.push_back({n, static_cast<std::size_t>(to)});
      }
  }

  /// force_residual = M vdot - weight.
  void add_inertial_forces(const Real* vdot, Real* force_residual) const {
    for (std::size_t i = 0; i < weight_.size(); ++i) force_residual[i] = -weight_[i];
    for (const Entry& entry : entries_)
      Eigen::Map<Vector3<Real>>(force_residual + entry.row) += entry.mass * Eigen::Map<const Vector3<Real>>(vdot + entry.column);
  }

  /// The tangent's values with M alone.
  const std::vector<Real>& tangent() const { return base_; }

  Vector3<Real> gravity(const Expressions<Real>& e) const { return {e[gravity_[0]], e[gravity_[1]], e[gravity_[2]]}; }

 private:
  struct Mass {
    int i, j, number;  ///< forms, register
    Real value{0};
  };
  struct Weight {
    int form, mass;
  };
  struct Entry {
    int row, column;
    Real mass;
  };
  struct Place {
    std::size_t entry, to;
  };

  static Eigen::Map<Vector3<Real>> three(Real* at) { return Eigen::Map<Vector3<Real>>(at); }

  /// All contributions by coordinates, row and column; of a pair of two forms also the other way round.
  template <class Visitor>
  void visit(Visitor visitor) const {
    for (const Mass& mass : masses_)
      for (const Term<Real>& s : forms_.terms(mass.i))
        for (const Term<Real>& t : forms_.terms(mass.j)) {
          const Real value = mass.value * s.coefficient * t.coefficient;
          visitor(s.at, t.at, value);
          if (mass.i != mass.j) visitor(t.at, s.at, value);
        }
  }

  const Forms<Real>& forms_;
  std::vector<Mass> masses_;
  std::vector<Weight> weights_;
  std::array<int, 3> gravity_{};
  std::map<std::pair<int, int>, std::size_t> numbers_;
  std::vector<Entry> entries_;
  std::vector<Place> places_;
  std::vector<Real> weight_, base_;
};

}  // namespace cutjoint::generic::natural
