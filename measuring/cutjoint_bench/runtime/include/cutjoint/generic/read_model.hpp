// From the compiler's description of a model (JSON, see generic/mechanism.py) to its records.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/model.hpp"

namespace cutjoint::generic {

inline Direction direction_named(const std::string& name) {
  static const std::map<std::string, Direction> directions = {
      {"axis", Direction::axis}, {"axis_2", Direction::axis_2}, {"normal", Direction::normal}, {"rod", Direction::rod},
      {"across_1", Direction::across_1}, {"across_2", Direction::across_2}, {"x", Direction::x}, {"y", Direction::y}, {"z", Direction::z}};
  return directions.at(name);
}

inline Motion read_motion_of_chain(const Json& json) {
  static const std::map<std::string, StepKind> kinds = {
      {"slide", StepKind::slide}, {"turn", StepKind::turn}, {"ball", StepKind::ball}, {"offset", StepKind::offset}};
  Motion m{.kind = kinds.at(json.at("kind"))};
  if (json.contains("direction")) m.direction = direction_named(json.at("direction"));
  m.coordinate = json.value("coordinate", 0);
  m.share = json.value("share", 1.0);
  m.advances = json.value("advances", false);
  return m;
}

/// ["displacement"], or the end that carries a direction, and the direction.
inline Factor read_factor(const Json& json) {
  const std::string end = json.at(0);
  if (end == "displacement") return {};
  return {end == "base" ? Factor::Kind::base : Factor::Kind::follower, direction_named(json.at(1))};
}

inline Condition read_condition(const Json& json) {
  static const std::map<std::string, ConditionKind> kinds = {
      {"same_point", ConditionKind::same_point}, {"same_direction", ConditionKind::same_direction},
      {"same_attitude", ConditionKind::same_attitude}, {"products", ConditionKind::products},
      {"same_distance", ConditionKind::same_distance}, {"advance", ConditionKind::advance}};
  Condition condition{.kind = kinds.at(json.at("kind"))};
  for (const std::string name : json.at("directions")) condition.directions.push_back(direction_named(name));
  for (const Json& sum : json.at("sums")) {
    auto& products = condition.sums.emplace_back();
    for (const Json& p : sum) products.push_back({read_factor(p.at("left")), read_factor(p.at("right")), p.at("weight")});
  }
  return condition;
}

/// A law over a named position and its rate.
template <class Real>
Law read_law(Expressions<Real>& e, const Json& json, const char* position) {
  Law law;
  law.position = e.variable(position);
  law.rate = e.variable("rate");
  law.value = e.routine([&] { law.force = e.read(json.at("force")); });
  law.tangents = e.routine([&] {
    law.stiffness = e.read(json.at("stiffness"));
    law.damping = e.read(json.at("damping"));
  });
  return law;
}

template <class Real>
TyreConstants read_constants(Expressions<Real>& e, const Json& c) {
  const auto of = [&](const char* name) { return e.read(c.at(name)); };
  return {of("stiffness"), of("radius"), of("spin_inertia"), of("A0"), of("A1"), of("A2"), of("A3"), of("A4"),
          of("B1"), of("B3"), of("B4"), of("SN"), of("AF1"), of("AF2")};
}

/// The names of the parameters, or of another list of the description.
inline std::vector<Names::Item> read_parameter_names(const Json& document, const char* list = "parameters") {
  std::vector<Names::Item> items;
  for (const Json& p : document.at(list)) items.push_back({p.at("name"), p.at("unit"), p.at("default")});
  return items;
}

/// Reads one model.  Throws std::runtime_error or a nlohmann exception on a description that does not hold together.
template <class Real>
class ModelReader {
 public:
  explicit ModelReader(const Json& document) : document_(document), model_(document.at("parameters").size(), document.value("inputs", Json::array())) {
    if (document.at("format") != "cutjoint-generic-1") throw std::runtime_error("not a description of a model for the generic mechanism");
  }

  Model<Real> read() {
    read_names();
    model_.gravity = model_.vectors.add(triple(document_.at("gravity")));
    model_.bodies.emplace_back();
    bodies_["ground"] = ground;
    origins_.push_back(-1);
    for (const Json& body : document_.at("bodies")) read_body(body);
    model_.nodes = static_cast<int>(model_.bodies.size());
    for (const Json& cut : document_.at("cuts")) read_cut(cut);
    for (const Json& gear : document_.at("gears")) read_gear(gear);
    for (const Json& force : document_.at("forces")) read_force(force);
    for (const Json& output : document_.at("outputs")) read_output(output);
    if (document_.contains("marks"))
      for (const Json& mark : document_.at("marks")) model_.marks.push_back(read_mark(mark));
    return std::move(model_);
  }

 private:
  void read_names() {
    Names& names = model_.names;
    names.model = document_.at("name");
    names.roads = document_.at("roads").template get<std::vector<std::string>>();
    names.parameters = read_parameter_names(document_);
    names.inputs = read_parameter_names(document_, "inputs");
  }

  /// "prefix.name" for each name.
  static void append_names(std::vector<std::string>& to, const Json& element, const char* key) {
    for (const std::string name : element.at(key)) to.push_back(element.at("name").template get<std::string>() + "." + name);
  }

  int number(const Json& tree) { return model_.expressions.read(tree); }

  std::array<int, 3> triple(const Json& trees) { return {number(trees.at(0)), number(trees.at(1)), number(trees.at(2))}; }

  int body(const Json& name) const { return bodies_.at(name.get<std::string>()); }

  Fixed point(int body, const Json& trees) {
    const int origin = origins_[static_cast<std::size_t>(body)];
    return {body, origin < 0 ? model_.vectors.add(triple(trees)) : model_.vectors.add(triple(trees), origin)};
  }

  Fixed direction(int body, const Json& trees) { return {body, model_.vectors.add(triple(trees))}; }

  Mark read_mark(const Json& json) {
    const int on = body(json.at("body"));
    if (json.at("kind") == "point") return {point(on, json.at("place")), true};
    return {direction(on, json.at("place")), false};
  }

  Joint read_joint(const Json& json) {
    Joint joint;
    for (const Json& motion : json.at("chain")) joint.chain.push_back(read_motion_of_chain(motion));
    for (const Json& condition : json.at("conditions")) joint.conditions.push_back(read_condition(condition));
    joint.from_inner = json.at("from_inner");
    joint.at = model_.vectors.add(triple(json.at("at")));
    joint.to = json.at("to").is_null() ? joint.at : model_.vectors.add(triple(json.at("to")));
    for (const Json& axis : json.at("axes")) joint.axes.push_back(model_.vectors.add(triple(axis)));
    if (!json.at("pitch").is_null()) joint.pitch = number(json.at("pitch"));
    return joint;
  }

  /// Of a distance joint the inner body has one end and the outer body the other; its origin is the joint's point of the outer body.
  void read_body(const Json& json) {
    const Json& joint = json.at("joint");
    const int self = static_cast<int>(model_.bodies.size());
    Body b;
    b.parent = body(json.at("parent"));
    b.root = b.parent == ground ? self : model_.body(b.parent).root;
    b.reversed = json.at("reversed");
    b.joint = read_joint(joint);
    b.inner = point(b.parent, joint.at(b.reversed && !joint.at("to").is_null() ? "to" : "at"));
    origins_.push_back(b.reversed ? b.joint.at : b.joint.to);
    read_coordinates(b, joint);
    read_inertia(b, self, json);
    bodies_[json.at("name")] = self;
    joints_[joint.at("name")] = self;
    model_.bodies.push_back(b);
  }

  void read_coordinates(Body& b, const Json& joint) {
    b.guided = !joint.at("guide").is_null();
    for (std::size_t i = 0; b.guided && i < joint.at("guide").size(); ++i) {
      const auto guide = triple(joint.at("guide").at(i));
      b.guides.at(i) = {guide[0], guide[1], guide[2]};
    }
    if (joint.at("q").is_null()) return;  // fixed or guided
    b.q = joint.at("q");
    b.v = joint.at("v");
    b.speeds = static_cast<int>(joint.at("speeds").size());
    append_names(model_.names.coordinates, joint, "coordinates");
    append_names(model_.names.speeds, joint, "speeds");
  }

  void read_inertia(Body& b, int self, const Json& json) {
    b.mass = number(json.at("mass"));
    b.massless = model_.expressions.is_constant(b.mass, 0.0);
    b.centre = point(self, json.at("centre_of_mass"));
    for (std::size_t i = 0; i < 6; ++i) {
      b.inertia[i] = number(json.at("inertia").at(i));
      b.massless = b.massless && model_.expressions.is_constant(b.inertia[i], 0.0);
    }
  }

  void read_cut(const Json& json) {
    Cut cut;
    cut.joint = read_joint(json);
    cut.base = point(body(json.at("base")), json.at("at"));
    cut.follower = point(body(json.at("follower")), json.at(json.at("to").is_null() ? "at" : "to"));
    cut.first = static_cast<int>(model_.names.equations.size());
    cut.size = static_cast<int>(json.at("equations").size());
    append_names(model_.names.equations, json, "equations");
    cuts_[json.at("name")] = static_cast<int>(model_.cuts.size());
    model_.cuts.push_back(cut);
  }

  void read_gear(const Json& json) {
    Gear gear;
    for (std::size_t i = 0; i < 2; ++i) {
      const Json& term = json.at("terms").at(i);
      gear.terms[i] = {body(term.at("body")), term.at("coordinate"), number(term.at("factor"))};
      Body& turned = model_.bodies[static_cast<std::size_t>(gear.terms[i].body)];
      if (!turned.guided && turned.node < 0) turned.node = model_.nodes++;
    }
    gear.equation = static_cast<int>(model_.names.equations.size());
    append_names(model_.names.equations, json, "equations");
    gears_[json.at("name")] = gear.equation;
    model_.gears.push_back(gear);
  }

  void read_force(const Json& json) {
    const std::string kind = json.at("kind");
    const int first = model_.quantities;
    std::vector<std::string> names;
    append_names(names, json, "quantities");
    for (const std::string& name : names) quantities_[name] = model_.quantities++;
    if (kind == "point_spring") read_point_spring(json, first);
    else if (kind == "axial_force") read_axial_force(json, first);
    else if (kind == "bushing") read_bushing(json, first);
    else if (kind == "load") read_load(json, first);
    else if (kind == "joint_force") read_joint_force(json, first);
    else if (kind == "tyre") read_tyre(json, first);
    else throw std::runtime_error("unknown kind of force '" + kind + "'");
  }

  void read_point_spring(const Json& json, int quantity) {
    const int base = body(json.at("base")), follower = body(json.at("follower"));
    model_.point_springs.push_back({point(base, json.at("start")), point(follower, json.at("end")),
                                    read_law(model_.expressions, json.at("law"), "length"), quantity});
  }

  void read_axial_force(const Json& json, int quantity) {
    const int base = body(json.at("base")), follower = body(json.at("follower"));
    model_.axial_forces.push_back({point(base, json.at("origin")), point(follower, json.at("point")), direction(base, json.at("axis")),
                                   read_law(model_.expressions, json.at("law"), "travel"), quantity});
  }

  void read_bushing(const Json& json, int quantity) {
    const int base = body(json.at("base")), follower = body(json.at("follower"));
    Bushing bushing{point(base, json.at("point")), point(follower, json.at("point")), {}, {}, quantity};
    for (std::size_t i = 0; i < 3; ++i) bushing.axes[i] = model_.vectors.add(triple(json.at("axes").at(i)));
    Expressions<Real>& e = model_.expressions;
    for (std::size_t i = 0; i < 6; ++i) {
      Law& law = bushing.laws[i];
      law.position = e.variable("position");
      law.rate = e.variable("rate");
      law.value = e.routine([&] { law.force = e.read(json.at("laws").at(i)); });
    }
    model_.bushings.push_back(bushing);
  }

  /// A torque has no point; its law uses the body's angular velocity.
  void read_load(const Json& json, int quantity) {
    BodyLoad load{};
    const int on = body(json.at("body"));
    load.torque = json.at("point").is_null();
    load.point = load.torque ? Fixed{on, -1} : point(on, json.at("point"));
    load.body_axes = json.at("axes") == "body";
    load.quantity = quantity;
    Expressions<Real>& e = model_.expressions;
    const char* const names[] = {"x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"};
    for (std::size_t i = 0; i < 9; ++i) load.place[i] = e.variable(names[i]);
    load.value = e.routine([&] { load.components = triple(json.at("components")); });
    model_.loads.push_back(load);
  }

  void read_joint_force(const Json& json, int quantity) {
    const Law law = read_law(model_.expressions, json.at("law"), "position");
    if (json.contains("cut")) model_.joint_forces.push_back({-1, read_cut_coordinate(json.at("cut")), law, quantity});
    else model_.joint_forces.push_back({body(json.at("body")), json.at("coordinate"), law, quantity});
  }

  int read_cut_coordinate(const Json& json) {
    const int base = body(json.at("base")), follower = body(json.at("follower"));
    CutCoordinate c{cuts_.at(json.at("joint")), point(base, json.at("point")), point(follower, json.at("point")), direction(base, json.at("axis")), {}};
    c.is_angle = json.at("angle");
    c.counts_turns = !json.at("turns").is_null();
    if (c.counts_turns)
      for (const Json& turn : json.at("turns")) c.turns.push_back({body(turn.at("body")), turn.at("coordinate"), turn.at("sign")});
    if (!json.at("pitch").is_null()) c.pitch = number(json.at("pitch"));
    model_.cut_coordinates.push_back(c);
    return static_cast<int>(model_.cut_coordinates.size()) - 1;
  }

  void read_tyre(const Json& json, int quantity) {
    const int on = body(json.at("body"));
    Tyre tyre{};
    tyre.centre = point(on, json.at("centre"));
    tyre.axis = direction(on, json.at("axis"));
    tyre.constants = read_constants(model_.expressions, json.at("constants"));
    tyre.road = json.at("road");
    tyre.quantity = quantity;
    model_.tyres.push_back(tyre);
  }

  void read_output(const Json& json) {
    model_.names.columns.push_back({json.at("name"), json.at("unit")});
    const std::string kind = json.at("kind");
    Output output;
    if (kind == "motion") output = read_motion(json);
    else if (kind == "reaction") output = read_reaction(json);
    else if (kind == "gear") output = {Quantity::gear_force, {}, gears_.at(json.at("gear"))};
    else if (kind == "force") output = {Quantity::force, {}, quantities_.at(json.at("quantity"))};
    else if (kind == "joint_position") output = {Quantity::joint_position, {body(json.at("body")), -1}, json.at("index")};
    else if (kind == "joint_rate") output = {Quantity::joint_rate, {body(json.at("body")), -1}, json.at("index")};
    else if (kind == "cut_position") output = {Quantity::cut_position, {}, read_cut_coordinate(json.at("cut"))};
    else if (kind == "cut_rate") output = {Quantity::cut_rate, {}, read_cut_coordinate(json.at("cut"))};
    else if (kind != "zero") throw std::runtime_error("unknown kind of output '" + kind + "'");
    model_.outputs.push_back(output);
  }

  Output read_reaction(const Json& json) {
    const std::string joint = json.at("joint");
    const auto cut = cuts_.find(joint);
    const bool in_tree = cut == cuts_.end();
    const Fixed follower = point(body(json.at("follower")), json.at("point"));
    model_.reactions.push_back({in_tree ? -1 : cut->second, in_tree ? joints_.at(joint) : -1, follower, json.at("moment")});
    return {Quantity::reaction, direction(body(json.at("body")), json.at("direction")), static_cast<int>(model_.reactions.size()) - 1};
  }

  /// x y z, vx vy vz, wx wy wz, ax ay az, roll pitch yaw.
  Output read_motion(const Json& json) {
    const std::string name = json.at("quantity");
    const Fixed at = point(body(json.at("body")), json.at("point"));
    if (name == "roll") return {Quantity::roll, at};
    if (name == "pitch") return {Quantity::pitch, at};
    if (name == "yaw") return {Quantity::yaw, at};
    const int axis = name.back() - 'x';
    const std::string what = name.substr(0, name.size() - 1);
    if (axis < 0 || axis > 2) throw std::runtime_error("a body has no quantity '" + name + "'");
    if (what.empty()) return {Quantity::position, at, axis};
    if (what == "v") return {Quantity::velocity, at, axis};
    if (what == "w") return {Quantity::angular_velocity, at, axis};
    if (what == "a") return {Quantity::acceleration, at, axis};
    throw std::runtime_error("a body has no quantity '" + name + "'");
  }

  const Json& document_;
  Model<Real> model_;
  std::map<std::string, int> bodies_, joints_, cuts_, gears_, quantities_;  ///< tree joints by their outer bodies
  std::vector<int> origins_;
};

template <class Real>
Model<Real> read_model(const Json& document) {
  return ModelReader<Real>(document).read();
}

}  // namespace cutjoint::generic
