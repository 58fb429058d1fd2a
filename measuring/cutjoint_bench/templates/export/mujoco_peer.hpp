// A model in MuJoCo whose forces are those of forces.hpp.
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "forces.hpp"
#include "program.hpp"

namespace exported {

/// A force on a scalar joint over the model's coordinate, which is `offset` at the start.
struct Law {
  const char* joint;
  double offset;
  double (*law)(double position, double rate, double t);
};

/// A scalar joint that time prescribes: coordinate, rate, acceleration.
struct Guide {
  const char* joint;
  std::array<double, 3> (*law)(double t);
};

/// What belongs to the MJCF file; `guide_inertia` is the armature of guided joints there.
struct Description {
  const char* file;
  std::span<const char* const> bodies;
  std::span<const Law> laws;
  std::span<const Guide> guides;
  double guide_inertia;
};

class MujocoPeer {
 public:
  MujocoPeer(const Options& options, const Description& description)
      : description_(description), model_(load(description.file)), data_(mj_makeData(model_.get())), motions_(description.bodies.size()),
        wrenches_(description.bodies.size()) {
    model_->opt.timestep = options.dt;
    std::string_view rule = options.integrator;
    if (constexpr std::string_view two = "_two_iterations"; rule.ends_with(two)) {
      rule.remove_suffix(two.size());
      model_->opt.iterations = 2;
    }
    model_->opt.integrator = integrator(rule);
    close_fast();
    for (const char* name : description.bodies) bodies_.push_back(find(mjOBJ_BODY, name));
    for (const Law& law : description.laws) laws_.push_back(find(mjOBJ_JOINT, law.joint));
    for (const Guide& guide : description.guides) guides_.push_back(find(mjOBJ_JOINT, guide.joint));
    mju_user_warning = [](const char*) {};
    mju_user_error = [](const char* message) {
      std::printf("{\"seconds\": 0, \"steps\": 0, \"status\": \"failed\", \"message\": %s}\n", quoted(message).c_str());
      std::exit(2);
    };
    active_ = this;
    mjcb_control = [](const mjModel*, mjData*) { active_->apply_forces(); };
    mj_resetDataKeyframe(model_.get(), data_.get(), 0);
    mj_forward(model_.get(), data_.get());
    mj_rnePostConstraint(model_.get(), data_.get());
    observe();
  }
  MujocoPeer(const MujocoPeer&) = delete;
  MujocoPeer& operator=(const MujocoPeer&) = delete;
  ~MujocoPeer() { mjcb_control = nullptr; }

  void step() {
    hold_guides();
    mj_step(model_.get(), data_.get());
    for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_->warning[warning].number > 0) throw std::runtime_error("the state is no longer finite, or too large");
  }

  /// Let motion() tell the state after the last step.
  void observe() {
    mj_kinematics(model_.get(), data_.get());
    mj_comPos(model_.get(), data_.get());
    mj_comVel(model_.get(), data_.get());
    read_motions();
  }

  const Motion& motion(int body) const { return motions_[static_cast<std::size_t>(body)]; }

  /// At the start.
  Acceleration acceleration(int body) const {
    double a[6];  // rotation first, and less gravity
    mj_objectAcceleration(model_.get(), data_.get(), mjOBJ_BODY, bodies_[static_cast<std::size_t>(body)], a, 0);
    const double* g = model_->opt.gravity;
    return {.a = {a[3] + g[0], a[4] + g[1], a[5] + g[2]}, .alpha = {a[0], a[1], a[2]}};
  }

 private:
  struct Delete {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };

  static std::unique_ptr<mjModel, Delete> load(const char* file) {
    char message[1000] = "";
    std::unique_ptr<mjModel, Delete> model(mj_loadXML(file, nullptr, message, sizeof message));
    if (!model) throw std::runtime_error(message);
    return model;
  }

  static int integrator(std::string_view name) {
    if (name == "euler") return mjINT_EULER;
    if (name == "rk4") return mjINT_RK4;
    if (name == "implicit") return mjINT_IMPLICIT;
    if (name == "implicitfast") return mjINT_IMPLICITFAST;
    throw std::invalid_argument("--integrator is euler, rk4, implicit or implicitfast, each with _two_iterations after it or without");
  }

  /// The shortest time constant in which each integrator closes gaps stably: a step with Runge-Kutta's rule, two with the others.
  void close_fast() {
    model_->opt.disableflags |= mjDSBL_REFSAFE;
    const double steps = model_->opt.integrator == mjINT_RK4 ? 1 : 2;
    for (int i = 0; i < model_->neq; ++i) model_->eq_solref[mjNREF * i] = steps * model_->opt.timestep;
  }

  int find(mjtObj kind, const char* name) const {
    const int id = mj_name2id(model_.get(), kind, name);
    if (id < 0) throw std::runtime_error(std::string("the MJCF file has no ") + name);
    return id;
  }

  /// Guided joints stand where time wants them at the beginning of a step; within it their inertia outweighs all else.
  void hold_guides() {
    for (std::size_t i = 0; i < guides_.size(); ++i) {
      const auto at_start = description_.guides[i].law(0.0), now = description_.guides[i].law(data_->time);
      data_->qpos[model_->jnt_qposadr[guides_[i]]] = now[0] - at_start[0];
      data_->qvel[model_->jnt_dofadr[guides_[i]]] = now[1];
    }
  }

  void read_motions() {
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const int id = bodies_[i];
      const double *R = data_->xmat + 9 * id, *p = data_->xipos + 3 * id, *twist = data_->cvel + 6 * id;
      const double* pole = data_->subtree_com + 3 * model_->body_rootid[id];
      const Vector place{p[0], p[1], p[2]}, w{twist[0], twist[1], twist[2]};
      const Vector v = Vector{twist[3], twist[4], twist[5]} + cross(w, place - Vector{pole[0], pole[1], pole[2]});
      motions_[i] = {.R = {{R[0], R[3], R[6]}, {R[1], R[4], R[7]}, {R[2], R[5], R[8]}}, .p = place, .v = v, .w = w};
    }
  }

  void apply_forces() {
    read_motions();
    std::fill(wrenches_.begin(), wrenches_.end(), Wrench{});
    add_forces(motions_.data(), data_->time, wrenches_.data());
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      double* applied = data_->xfrc_applied + 6 * bodies_[i];
      const auto& [f, m] = wrenches_[i];
      for (const double value : {f.x, f.y, f.z, m.x, m.y, m.z}) *applied++ = value;
    }
    for (std::size_t i = 0; i < laws_.size(); ++i) data_->qfrc_applied[model_->jnt_dofadr[laws_[i]]] = 0;
    for (std::size_t i = 0; i < laws_.size(); ++i) {
      const int dof = model_->jnt_dofadr[laws_[i]];
      const double position = description_.laws[i].offset + data_->qpos[model_->jnt_qposadr[laws_[i]]];
      data_->qfrc_applied[dof] += description_.laws[i].law(position, data_->qvel[dof], data_->time);
    }
    for (std::size_t i = 0; i < guides_.size(); ++i)
      data_->qfrc_applied[model_->jnt_dofadr[guides_[i]]] = description_.guide_inertia * description_.guides[i].law(data_->time)[2];
  }

  static inline MujocoPeer* active_ = nullptr;
  Description description_;
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
  std::vector<int> bodies_, laws_, guides_;
  std::vector<Motion> motions_;
  std::vector<Wrench> wrenches_;
};

}  // namespace exported
