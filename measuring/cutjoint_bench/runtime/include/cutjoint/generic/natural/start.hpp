// Natural coordinates for given relative ones, by the kinematics of the generic mechanism.
#pragma once

#include <vector>

#include "cutjoint/generic/kinematics.hpp"
#include "cutjoint/generic/read_model.hpp"

namespace cutjoint::generic::natural {

template <class Real>
class Start {
 public:
  explicit Start(const Json& document) : model_(read_model<Real>(document.at("start"))), kinematics_(model_) {
    std::map<std::string, int> bodies;
    for (const Json& body : document.at("start").at("bodies")) bodies[body.at("name")] = static_cast<int>(bodies.size()) + 1;
    for (const Json& node : document.at("nodes"))
      if (node.contains("coordinate")) read(node, bodies);
  }

  void load(const Real* parameters) {
    model_.expressions.load(parameters);
    model_.vectors.load(model_.expressions);
    kinematics_.load();
  }

  void drive_by(const InputSource<Real>& source) { model_.expressions.drive_by(source); }

  void begin_step(Real t, Real motion) {
    model_.expressions.begin_step(t, motion);
    kinematics_.begin_step();
  }

  void initial_coordinates(const Real* relative_q, const Real* relative_v, Real* q, Real* v) {
    kinematics_.update(relative_q, relative_v);
    for (const Coordinate& c : coordinates_) {
      if (c.mark >= 0) {
        Eigen::Map<Vector3<Real>>(q + c.at) = position(c.mark);
        Eigen::Map<Vector3<Real>>(v + c.at) = rate(c.mark);
      } else if (c.body >= 0) {
        q[c.at] = kinematics_.position(c.body, c.index, relative_q);
        v[c.at] = kinematics_.rate(c.body, c.index, relative_v);
      } else {
        const Real pitch = model_.expressions[c.pitch];
        q[c.at] = position(c.axis).dot(position(c.end) - position(c.start)) / pitch;
        v[c.at] = position(c.axis).dot(rate(c.end) - rate(c.start)) / pitch;
      }
    }
  }

 private:
  /// A mark, a joint's coordinate, or a screw's angle by its advance.
  struct Coordinate {
    int at, mark = -1, body = -1, index = 0, axis = -1, end = -1, start = -1, pitch = -1;
  };

  void read(const Json& node, const std::map<std::string, int>& bodies) {
    const Json& place = node.at("place");
    Coordinate c{.at = node.at("coordinate")};
    if (place.contains("mark")) c.mark = place.at("mark");
    else if (place.contains("body")) c.body = bodies.at(place.at("body")), c.index = place.at("index");
    else {
      c.axis = place.at("axis"), c.end = place.at("end"), c.start = place.at("start");
      c.pitch = model_.expressions.read(place.at("pitch"));
    }
    coordinates_.push_back(c);
  }

  const Fixed& mark(int i) const { return model_.marks.at(static_cast<std::size_t>(i)).at; }

  Vector3<Real> position(int i) const {
    const Fixed& at = mark(i);
    return is_point(i) ? Vector3<Real>(kinematics_.point(at) + kinematics_.frame(at.body).pole) : kinematics_.direction(at);
  }

  Vector3<Real> rate(int i) const {
    const Fixed& at = mark(i);
    if (is_point(i)) return kinematics_.velocity(at.body, kinematics_.point(at));
    const Vector3<Real> spin = kinematics_.frame(at.body).Z.template tail<3>();
    return spin.cross(kinematics_.direction(at));
  }

  bool is_point(int i) const { return model_.marks[static_cast<std::size_t>(i)].is_point; }

  Model<Real> model_;
  Kinematics<Real> kinematics_;
  std::vector<Coordinate> coordinates_;
};

}  // namespace cutjoint::generic::natural
