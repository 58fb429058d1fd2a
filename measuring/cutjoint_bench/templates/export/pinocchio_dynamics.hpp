// Accelerations by Pinocchio's algorithms, apart from the rest of the peer: their templates take a compiler minutes.
#pragma once

#include <pinocchio/algorithm/proximal.hpp>
#include <pinocchio/constraints.hpp>
#include <pinocchio/multibody.hpp>
#include <vector>

namespace exported {

/// Loops: none; a sparse factorisation of the constrained system; the articulated-body algorithm for loops (LCABA).
enum class Dynamics { tree, factorised, articulated };

struct Contacts {
  std::vector<pinocchio::RigidConstraintModel> models;
  std::vector<pinocchio::RigidConstraintData> data;
};

void prepare(Dynamics dynamics, const pinocchio::Model& model, pinocchio::Data& data, const Contacts& contacts);

const Eigen::VectorXd& accelerations(Dynamics dynamics, const pinocchio::Model& model, pinocchio::Data& data, const Eigen::VectorXd& q,
                                     const Eigen::VectorXd& v, const Eigen::VectorXd& tau, Contacts& contacts,
                                     pinocchio::ProximalSettings& settings);

}  // namespace exported
