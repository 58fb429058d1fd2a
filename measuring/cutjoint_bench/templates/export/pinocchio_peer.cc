// The peer in Pinocchio: builds the model of a Tree, evaluates its accelerations, and steps them.
#include "pinocchio_peer.hpp"

#include <algorithm>
#include <cmath>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pinocchio_dynamics.hpp"

namespace exported {

namespace {

namespace pin = pinocchio;
using Eigen::Matrix3d, Eigen::Vector3d, Eigen::VectorXd;
using Index = Eigen::Index;

/// Guided joints have this many times the mass of all bodies as armature: what reacts on them moves them by a billionth.
constexpr double guide_inertia = 1e9;

Vector3d eigen(Vector a) { return {a.x, a.y, a.z}; }
Vector vector(const Vector3d& a) { return {a.x(), a.y(), a.z()}; }
Rotation rotation(const Matrix3d& R) { return {vector(R.col(0)), vector(R.col(1)), vector(R.col(2))}; }
pin::SE3 shift(const Vector3d& way) { return {Matrix3d::Identity(), way}; }
std::size_t at(int i) { return static_cast<std::size_t>(i); }
/// Pinocchio counts joints from the universe, which is number 0.
pin::JointIndex number(int joint) { return static_cast<pin::JointIndex>(joint + 1); }

pin::JointModel joint_model(const Joint& joint) {
  const Vector3d axis = eigen(joint.axis);
  const auto is = [&](double x, double y, double z) { return axis == Vector3d(x, y, z); };
  switch (joint.kind) {
    case Joint::hinge:
      if (is(1, 0, 0)) return pin::JointModelRX();
      if (is(0, 1, 0)) return pin::JointModelRY();
      if (is(0, 0, 1)) return pin::JointModelRZ();
      return pin::JointModelRevoluteUnaligned(axis);
    case Joint::slide:
      if (is(1, 0, 0)) return pin::JointModelPX();
      if (is(0, 1, 0)) return pin::JointModelPY();
      if (is(0, 0, 1)) return pin::JointModelPZ();
      return pin::JointModelPrismaticUnaligned(axis);
    case Joint::screw: return pin::JointModelHelicalUnaligned(axis, joint.pitch);
    case Joint::ball: return pin::JointModelSpherical();
    case Joint::free: return pin::JointModelFreeFlyer();
  }
  throw std::logic_error("no such joint");
}

pin::Model build_model(const Tree& tree) {
  pin::Model model;
  model.gravity.linear() = eigen(tree.gravity);
  for (const Joint& joint : tree.joints) {
    const Vector3d from = joint.parent == no_joint ? Vector3d::Zero() : eigen(tree.joints[at(joint.parent)].point);
    model.addJoint(number(joint.parent), joint_model(joint), shift(eigen(joint.point) - from), joint.name);
  }
  double total = 0;
  for (const Mass& mass : tree.masses) {
    const auto& j = mass.inertia;
    const Vector3d centre = eigen(mass.centre - tree.joints[at(mass.joint)].point);
    model.appendBodyToJoint(number(mass.joint), pin::Inertia(mass.mass, centre, pin::Symmetric3(j[0], j[1], j[2], j[3], j[4], j[5])));
    total += mass.mass;
  }
  for (const Guide& guide : tree.guides) model.armature[model.idx_vs[number(guide.joint)]] = guide_inertia * total;
  return model;
}

Contacts build_contacts(const Tree& tree, const pin::Model& model) {
  Contacts contacts;
  const auto arm = [&](int joint, Vector point) {
    return shift(eigen(joint == no_joint ? point : point - tree.joints[at(joint)].point));
  };
  for (const Contact& c : tree.contacts) {
    auto& contact = contacts.models.emplace_back(c.weld ? pin::CONTACT_6D : pin::CONTACT_3D, model, number(c.first), arm(c.first, c.on_first),
                                          number(c.second), arm(c.second, c.on_second), pin::LOCAL);
    contact.baumgarte_corrector_parameters().Kp = tree.frequency * tree.frequency;
    contact.baumgarte_corrector_parameters().Kd = 2 * tree.ratio * tree.frequency;
    contacts.data.emplace_back(contact);
  }
  return contacts;
}

/// Rates of the coordinates, quaternions' included.
void coordinate_rates(const Tree& tree, const pin::Model& model, const VectorXd& q, const VectorXd& v, VectorXd& rates) {
  const auto turn = [&](Index iq, Index iv) {
    const Eigen::Quaterniond spin(0, v[iv], v[iv + 1], v[iv + 2]);
    rates.segment<4>(iq) = 0.5 * (Eigen::Quaterniond(q.segment<4>(iq)) * spin).coeffs();
  };
  for (std::size_t i = 0; i < tree.joints.size(); ++i) {
    const Index iq = model.idx_qs[i + 1], iv = model.idx_vs[i + 1];
    if (tree.joints[i].kind == Joint::ball) turn(iq, iv);
    else if (tree.joints[i].kind == Joint::free) {
      rates.segment<3>(iq) = Eigen::Quaterniond(q.segment<4>(iq + 3)) * v.segment<3>(iv);
      turn(iq + 3, iv + 3);
    } else rates[iq] = v[iv];
  }
}

}  // namespace

class PinocchioPeer::Engine {
 public:
  Engine(const Options& options, const Tree& tree)
      : tree_(tree), dt_(options.dt), model_(build_model(tree)), data_(model_), contacts_(build_contacts(tree, model_)),
        motions_(tree.bodies.size()), wrenches_(tree.bodies.size()), loads_(tree.joints.size()), q_(pin::neutral(model_)),
        v_(VectorXd::Zero(model_.nv)), tau_(v_) {
    constexpr std::string_view articulated = "lcaba_";
    std::string_view rule = options.integrator;
    const bool lcaba = rule.starts_with(articulated);
    if (lcaba) rule.remove_prefix(articulated.size());
    euler_ = rule == "semi_implicit_euler", adaptive_ = rule == "dormand_prince";
    if (!euler_ && !adaptive_ && !rule.empty() && rule != "rk4")
      throw std::invalid_argument("--integrator is rk4, semi_implicit_euler or dormand_prince, each with lcaba_ before it or without");
    dynamics_ = contacts_.models.empty() ? Dynamics::tree : lcaba ? Dynamics::articulated : Dynamics::factorised;
    proximal_ = lcaba ? tree.articulated : tree.factorised;
    prepare(dynamics_, model_, data_, contacts_);
    settings_.mu = proximal_.compliance * static_cast<double>(tree.masses.size()) / total_mass();
    settings_.max_iter = proximal_.iterations;
    settings_.relative_accuracy = 0;
    for (std::size_t i = 0; i < tree.joints.size(); ++i)
      for (int k = 0; k < model_.nvs[i + 1]; ++k) v_[model_.idx_vs[i + 1] + k] = tree.joints[i].speeds[at(k)];
    follow_guides(0, q_, v_);
    for (Stage& stage : stages_) stage = {q_, v_, q_, v_};
    tolerance_ = options.tolerance, end_ = dt_ * std::ceil(options.end / dt_ - 1e-9), ahead_ = end_ / 1000;
    observe();
    start_ = accelerations(0, q_, v_);
  }

  void step() {
    if (euler_) {
      v_ += dt_ * accelerations(time(), q_, v_);
      q_ = pin::integrate(model_, q_, dt_ * v_);
    } else if (adaptive_) dormand_prince();
    else runge_kutta();
    ++steps_;
    pin::normalize(model_, q_);
    follow_guides(time(), q_, v_);
  }

  void observe() {
    pin::forwardKinematics(model_, data_, q_, v_);
    read_motions();
  }

  const Motion& motion(int body) const { return motions_[at(body)]; }

  Acceleration acceleration(int body) const {
    pin::Data data(model_);
    pin::forwardKinematics(model_, data, q_, v_, start_);
    const pin::JointIndex joint = number(tree_.bodies[at(body)].joint);
    const Vector3d c = eigen(tree_.bodies[at(body)].centre - tree_.joints[at(tree_.bodies[at(body)].joint)].point);
    const pin::Motion &v = data.v[joint], &a = data.a[joint];
    const Matrix3d& R = data.oMi[joint].rotation();
    const Vector3d w = v.angular();
    const Vector3d of_centre = a.linear() + w.cross(v.linear()) + a.angular().cross(c) + w.cross(w.cross(c));
    return {.a = vector(R * of_centre), .alpha = vector(R * a.angular())};
  }

 private:
  struct Stage {
    VectorXd q, v, q_rates, a;
  };

  double time() const { return static_cast<double>(steps_) * dt_; }

  double total_mass() const {
    double total = 0;
    for (const Mass& mass : tree_.masses) total += mass.mass;
    return total;
  }

  void follow_guides(double t, VectorXd& q, VectorXd& v) const {
    for (const Guide& guide : tree_.guides) {
      const auto now = guide.law(t), start = guide.law(0);
      q[model_.idx_qs[number(guide.joint)]] = now[0] - start[0];
      v[model_.idx_vs[number(guide.joint)]] = now[1];
    }
  }

  /// Four stages on coordinates and speeds; a quaternion is made one of length one before it is used.
  void runge_kutta() {
    constexpr double ahead[] = {0, 0.5, 0.5, 1};
    for (std::size_t i = 0; i < 4; ++i) {
      Stage& stage = stages_[i];
      const double h = ahead[i] * dt_, t = time() + h;
      stage.q = q_, stage.v = v_;
      if (i > 0) stage.q += h * stages_[i - 1].q_rates, stage.v += h * stages_[i - 1].a;
      evaluate(t, stage);
    }
    const auto& [k1, k2, k3, k4, _5, _6, _7] = stages_;
    q_ += dt_ / 6 * (k1.q_rates + 2 * k2.q_rates + 2 * k3.q_rates + k4.q_rates);
    v_ += dt_ / 6 * (k1.a + 2 * k2.a + 2 * k3.a + k4.a);
  }

  /// The derivative of a stage, whose quaternions and guided joints are put right first.
  void evaluate(double t, Stage& stage) {
    pin::normalize(model_, stage.q);
    follow_guides(t, stage.q, stage.v);
    coordinate_rates(tree_, model_, stage.q, stage.v, stage.q_rates);
    stage.a = accelerations(t, stage.q, stage.v);
  }

  /// Steps of Dormand's and Prince's rule of orders 5 and 4 until they pass the next row, which is interpolated.
  void dormand_prince() {
    const double row = time() + dt_;
    while (reached_ < row - 1e-12 * row) take_step();
    interpolate(1 - (reached_ - row) / taken_);
  }

  /// From stages_[0] to stages_[6].  The root mean square of the errors of coordinates and speeds, each by 1 and its size, stays within the
  /// tolerance.
  void take_step() {
    static constexpr double c[] = {0, 1. / 5, 3. / 10, 4. / 5, 8. / 9, 1, 1};
    static constexpr double a[7][6] = {{},
                                       {1. / 5},
                                       {3. / 40, 9. / 40},
                                       {44. / 45, -56. / 15, 32. / 9},
                                       {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
                                       {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
                                       {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84}};
    static constexpr double e[] = {71. / 57600, 0, -71. / 16695, 71. / 1920, -17253. / 339200, 22. / 525, -1. / 40};
    if (reached_ == 0) stages_[0].q = q_, stages_[0].v = v_, evaluate(0, stages_[0]);
    else std::swap(stages_[0], stages_[6]);
    const VectorXd &q = stages_[0].q, &v = stages_[0].v;
    for (double error = 2; error > 1;) {
      taken_ = std::min(ahead_, end_ - reached_);
      for (std::size_t i = 1; i < 7; ++i) {
        stages_[i].q = q, stages_[i].v = v;
        for (std::size_t j = 0; j < i; ++j)
          if (a[i][j] != 0) stages_[i].q += taken_ * a[i][j] * stages_[j].q_rates, stages_[i].v += taken_ * a[i][j] * stages_[j].a;
        evaluate(reached_ + c[i] * taken_, stages_[i]);
      }
      const auto [q_error, v_error] = combined(e);
      const double squares =
          (q_error.array() / (1 + q.array().abs())).square().sum() + (v_error.array() / (1 + v.array().abs())).square().sum();
      error = std::sqrt(squares / static_cast<double>(model_.nq + model_.nv)) / tolerance_;
      if (!(error <= 1e100) || taken_ < 1e-14) throw std::runtime_error("no step is small enough");
      ahead_ = taken_ * std::clamp(0.9 * std::pow(std::max(error, 1e-10), -0.2), 0.2, 5.0);
    }
    reached_ += taken_;
  }

  /// The step times a sum of the stages' derivatives.
  std::pair<VectorXd, VectorXd> combined(const double (&weights)[7]) const {
    VectorXd q = VectorXd::Zero(model_.nq), v = VectorXd::Zero(model_.nv);
    for (std::size_t i = 0; i < 7; ++i) q += taken_ * weights[i] * stages_[i].q_rates, v += taken_ * weights[i] * stages_[i].a;
    return {q, v};
  }

  /// The state at a share of the last step, to fourth order (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.6).
  void interpolate(double share) {
    static constexpr double d[] = {-12715105075. / 11282082432, 0, 87487479700. / 32700410799, -10690763975. / 1880347072,
                                   701980252875. / 199316789632, -1453857185. / 822651844, 69997945. / 29380423};
    const auto [q_rest, v_rest] = combined(d);
    const auto between = [&](const VectorXd& from, const VectorXd& to, const VectorXd& rate, const VectorXd& end_rate, const VectorXd& rest) {
      const VectorXd way = to - from, first = taken_ * rate - way, second = way - taken_ * end_rate - first;
      return VectorXd(from + share * (way + (1 - share) * (first + share * (second + (1 - share) * rest))));
    };
    const Stage &from = stages_[0], &to = stages_[6];
    q_ = between(from.q, to.q, from.q_rates, to.q_rates, q_rest);
    v_ = between(from.v, to.v, from.a, to.a, v_rest);
  }

  const VectorXd& accelerations(double t, const VectorXd& q, const VectorXd& v) {
    tau_.setZero();
    if (tree_.add_forces != nullptr) apply_forces(t, q, v);
    for (const Law& law : tree_.laws) {
      const Index iq = model_.idx_qs[number(law.joint)], iv = model_.idx_vs[number(law.joint)];
      tau_[iv] += law.law(law.offset + q[iq], v[iv], t);
    }
    for (const Guide& guide : tree_.guides) {
      const Index iv = model_.idx_vs[number(guide.joint)];
      tau_[iv] = model_.armature[iv] * guide.law(t)[2];
    }
    const VectorXd& found = exported::accelerations(dynamics_, model_, data_, q, v, tau_, contacts_, settings_);
    if (!found.allFinite()) throw std::runtime_error("the accelerations are not finite: the step is too large, or a motion moves no mass");
    settings_.absolute_accuracy = proximal_.accuracy * (1 + found.lpNorm<Eigen::Infinity>());
    return found;
  }

  void read_motions() {
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const auto [joint, centre] = tree_.bodies[i];
      const pin::SE3& place = data_.oMi[number(joint)];
      const pin::Motion& twist = data_.v[number(joint)];
      const Vector3d c = eigen(centre - tree_.joints[at(joint)].point), &w = twist.angular();
      const Matrix3d& R = place.rotation();
      motions_[i] = {.R = rotation(R), .p = vector(place.act(c)), .v = vector(R * (twist.linear() + w.cross(c))), .w = vector(R * w)};
    }
  }

  /// The wrenches on the bodies, passed on from the outermost joints to the ground; each joint takes what works on its motion.
  void apply_forces(double t, const VectorXd& q, const VectorXd& v) {
    pin::forwardKinematics(model_, data_, q, v);
    read_motions();
    std::fill(wrenches_.begin(), wrenches_.end(), Wrench{});
    std::fill(loads_.begin(), loads_.end(), Wrench{});
    tree_.add_forces(motions_.data(), t, wrenches_.data());
    for (std::size_t i = 0; i < motions_.size(); ++i)
      take(tree_.bodies[i].joint, wrenches_[i], motions_[i].p);
    for (int joint = static_cast<int>(loads_.size()) - 1; joint >= 0; --joint) {
      work(joint);
      if (const int parent = tree_.joints[at(joint)].parent; parent != no_joint) take(parent, loads_[at(joint)], origin(joint));
    }
  }

  Vector origin(int joint) const { return vector(data_.oMi[number(joint)].translation()); }

  /// A wrench at a place, moved to a joint.
  void take(int joint, const Wrench& wrench, Vector place) {
    loads_[at(joint)].force += wrench.force;
    loads_[at(joint)].torque += wrench.torque + cross(place - origin(joint), wrench.force);
  }

  void work(int joint) {
    const Joint& own = tree_.joints[at(joint)];
    const Vector3d force = eigen(loads_[at(joint)].force), torque = eigen(loads_[at(joint)].torque);
    const Matrix3d& R = data_.oMi[number(joint)].rotation();
    const Index iv = model_.idx_vs[number(joint)];
    const Vector3d axis = R * eigen(own.axis);
    switch (own.kind) {
      case Joint::hinge: tau_[iv] += axis.dot(torque); break;
      case Joint::slide: tau_[iv] += axis.dot(force); break;
      case Joint::screw: tau_[iv] += axis.dot(torque) + own.pitch * axis.dot(force); break;
      case Joint::ball: tau_.segment<3>(iv) += R.transpose() * torque; break;
      case Joint::free:
        tau_.segment<3>(iv) += R.transpose() * force;
        tau_.segment<3>(iv + 3) += R.transpose() * torque;
    }
  }

  Tree tree_;
  /// Of dormand_prince(): the time that steps have come to, the length of the last one and of the next.
  double dt_, tolerance_ = 0, end_ = 0, reached_ = 0, taken_ = 0, ahead_ = 0;
  bool euler_ = false, adaptive_ = false;
  Dynamics dynamics_ = Dynamics::tree;
  Proximal proximal_;
  long steps_ = 0;
  pin::Model model_;
  pin::Data data_;
  Contacts contacts_;
  pin::ProximalSettings settings_;
  std::vector<Motion> motions_;
  std::vector<Wrench> wrenches_, loads_;
  VectorXd q_, v_, tau_, start_;
  std::array<Stage, 7> stages_;
};

PinocchioPeer::PinocchioPeer(const Options& options, const Tree& tree) : engine_(std::make_unique<Engine>(options, tree)) {}
PinocchioPeer::PinocchioPeer(PinocchioPeer&&) noexcept = default;
PinocchioPeer::~PinocchioPeer() = default;
void PinocchioPeer::step() { engine_->step(); }
void PinocchioPeer::observe() { engine_->observe(); }
const Motion& PinocchioPeer::motion(int body) const { return engine_->motion(body); }
Acceleration PinocchioPeer::acceleration(int body) const { return engine_->acceleration(body); }

}  // namespace exported
