// Reported quantities: motion of points and bodies, joint coordinates, forces, reactions.
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/natural/forces.hpp"
#include "cutjoint/generic/natural/rows.hpp"

namespace cutjoint::generic::natural {

/// The quantity of a column; `axis` is an element of a vector, `forms` are its arguments.
enum class Quantity {
  zero, force,
  position, velocity, acceleration,  ///< of a form
  spin,                              ///< of three axes
  relative_spin,                     ///< of three axes against three others, along a direction
  roll, pitch, yaw,                  ///< of three axes
  angle, angle_rate,                 ///< an element of q or v
  slide, slide_rate,                 ///< a way along an axis
  course,                            ///< a register
  reaction, gear_force
};

/// Forces, equations and the values and motion of all forms must belong to the instant.
template <class Real>
class Reporter {
 public:
  Reporter(const Json& outputs, Expressions<Real>& e, const Forms<Real>& forms, const Rows<Real>& rows, const Forces<Real>& forces)
      : e_(e), forms_(forms), rows_(rows), forces_(forces) {
    for (const Json& json : outputs) read(json);
  }

  void report(const Real* q, const Real* v, const Real* lambda, const Vector3<Real>& gravity, Real* column) const {
    for (const Output& output : outputs_) *column++ = value(output, q, v, lambda, gravity);
  }

 private:
  using Axes = std::array<int, 3>;  ///< forms; the first is negative of a body that stands still

  struct Share {
    std::size_t of;    ///< equation or force
    std::size_t form;  ///< of its forms
    int share;         ///< register
  };

  /// A joint's force: what is left over of the balance of these shares.
  struct Reaction {
    Real sign;
    int weight;
    std::vector<std::pair<int, int>> masses;  ///< form, register
    std::vector<Share> rows, forces;
  };

  struct Output {
    Quantity quantity = Quantity::zero;
    int form = -1, other = -1, axis = 0;
    std::size_t number = 0;
    Axes axes{-1, -1, -1}, inner{-1, -1, -1};
  };

  static Axes axes_of(const Json& json) {
    if (json.is_null()) return {-1, -1, -1};
    return {json.at(0), json.at(1), json.at(2)};
  }

  void read(const Json& json) {
    static const std::map<std::string, Quantity> motions = {
        {"position", Quantity::position}, {"velocity", Quantity::velocity}, {"acceleration", Quantity::acceleration}};
    static const std::map<std::string, Quantity> attitudes = {{"roll", Quantity::roll}, {"pitch", Quantity::pitch}, {"yaw", Quantity::yaw}};
    const std::string kind = json.at("kind");
    Output o;
    const bool is_rate = json.value("rate", false);
    if (const auto motion = motions.find(kind); motion != motions.end()) {
      o.quantity = motion->second, o.form = json.at("form"), o.axis = json.at("axis");
    } else if (kind == "spin") {
      o.quantity = Quantity::spin, o.axes = axes_of(json.at("axes")), o.axis = json.at("axis");
    } else if (kind == "relative_spin") {
      o.quantity = Quantity::relative_spin, o.form = json.at("direction");
      o.axes = axes_of(json.at("outer")), o.inner = axes_of(json.at("inner"));
    } else if (kind == "attitude") {
      o.quantity = attitudes.at(json.at("angle")), o.axes = axes_of(json.at("axes"));
    } else if (kind == "force") {
      o.quantity = Quantity::force, o.number = forces_.quantity(json.at("quantity"));
    } else if (kind == "angle") {
      o.quantity = is_rate ? Quantity::angle_rate : Quantity::angle, o.form = forms_.angle(json.at("angle"));
    } else if (kind == "slide") {
      o.quantity = is_rate ? Quantity::slide_rate : Quantity::slide, o.form = json.at("displacement"), o.other = json.at("axis");
    } else if (kind == "course") {
      o.quantity = Quantity::course, o.form = e_.read(json.at("course").at(is_rate ? 1 : 0));
    } else if (kind == "reaction") {
      o.quantity = Quantity::reaction, o.form = json.at("direction"), o.number = reactions_.size();
      reactions_.push_back(read_reaction(json));
    } else if (kind == "gear") {
      o.quantity = Quantity::gear_force, o.number = json.at("equation");
    } else if (kind != "zero") {
      throw std::runtime_error("unknown kind of output '" + kind + "'");
    }
    outputs_.push_back(o);
  }

  Reaction read_reaction(const Json& json) {
    Reaction reaction{Real(json.at("sign").get<double>()), e_.read(json.at("weight")), {}, {}, {}};
    for (const Json& m : json.at("masses")) reaction.masses.emplace_back(m.at(0), e_.read(m.at(1)));
    reaction.rows = read_shares(json.at("rows"));
    reaction.forces = read_shares(json.at("forces"));
    return reaction;
  }

  std::vector<Share> read_shares(const Json& list) {
    std::vector<Share> shares;
    for (const Json& item : list)
      for (std::size_t i = 0; i < item.at(1).size(); ++i) shares.push_back({item.at(0), i, e_.read(item.at(1).at(i))});
    return shares;
  }

  Real value(const Output& o, const Real* q, const Real* v, const Real* lambda, const Vector3<Real>& gravity) const {
    switch (o.quantity) {
      case Quantity::zero: return Real(0);
      case Quantity::force: return forces_.value(o.number);
      case Quantity::position: return forms_.x(o.form)[o.axis];
      case Quantity::velocity: return forms_.v(o.form)[o.axis];
      case Quantity::acceleration: return forms_.a(o.form)[o.axis];
      case Quantity::spin: return spin(o.axes)[o.axis];
      case Quantity::relative_spin: return forms_.x(o.form).dot(spin(o.axes) - spin(o.inner));
      case Quantity::angle: return q[o.form];
      case Quantity::angle_rate: return v[o.form];
      case Quantity::slide: return forms_.x(o.form).dot(forms_.x(o.other));
      case Quantity::slide_rate: return forms_.v(o.form).dot(forms_.x(o.other)) + forms_.x(o.form).dot(forms_.v(o.other));
      case Quantity::course: return e_[o.form];
      case Quantity::reaction: return forms_.x(o.form).dot(reaction_force(reactions_[o.number], lambda, gravity));
      case Quantity::gear_force: return -lambda[o.number];
      default: return attitude(o);
    }
  }

  /// Half the sum of e x e'.
  Vector3<Real> spin(const Axes& axes) const {
    Vector3<Real> sum = Vector3<Real>::Zero();
    if (axes[0] < 0) return sum;
    for (const int axis : axes) sum += forms_.x(axis).cross(forms_.v(axis));
    return sum / Real(2);
  }

  /// Yaw, pitch and roll about z, y, x in turn.
  Real attitude(const Output& o) const {
    using std::atan2, std::hypot;
    const Vector3<Real>&x = forms_.x(o.axes[0]), &y = forms_.x(o.axes[1]), &z = forms_.x(o.axes[2]);
    if (o.quantity == Quantity::roll) return atan2(y.z(), z.z());
    if (o.quantity == Quantity::pitch) return atan2(-x.z(), hypot(y.z(), z.z()));
    return atan2(x.y(), x.x());
  }

  Vector3<Real> reaction_force(const Reaction& reaction, const Real* lambda, const Vector3<Real>& gravity) const {
    Vector3<Real> sum = -e_[reaction.weight] * gravity;
    for (const auto& [form, mass] : reaction.masses) sum += e_[mass] * forms_.a(form);
    for (const Share& s : reaction.rows) sum += e_[s.share] * lambda[s.of] * rows_.by_form(s.of, s.form);
    for (const Share& s : reaction.forces) sum -= e_[s.share] * forces_.element(s.of).on_form(s.form);
    return reaction.sign * sum;
  }

  Expressions<Real>& e_;
  const Forms<Real>& forms_;
  const Rows<Real>& rows_;
  const Forces<Real>& forces_;
  std::vector<Output> outputs_;
  std::vector<Reaction> reactions_;
};

}  // namespace cutjoint::generic::natural
