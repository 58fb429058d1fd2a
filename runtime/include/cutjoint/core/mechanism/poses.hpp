// Poses of all bodies and markers of a simulation, for display and sound.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace cutjoint {

/// The numbers of a pose as generated code has them: position, rotation by columns, velocity, angular velocity, design point.
inline constexpr std::size_t numbers_per_pose = 21;

/// The unit quaternion w, x, y, z of a rotation, by columns; of the two equivalent ones that with w >= 0 (Shepperd, J. Guidance and Control 1
/// (1978) 223: by the largest of the four, so that no digits are lost).
inline void quaternion_of(const double* columns, double* quaternion) {
  const auto R = [columns](std::size_t i, std::size_t j) { return columns[3 * j + i]; };
  const double trace = R(0, 0) + R(1, 1) + R(2, 2);
  std::size_t largest = 0;
  double most = trace;
  for (std::size_t i = 0; i < 3; ++i)
    if (R(i, i) > most) most = R(i, i), largest = i + 1;
  const double root = std::sqrt(1.0 + 2.0 * most - trace);  // twice the largest of the four
  const double part = 0.5 / root;
  if (largest == 0) {
    quaternion[1] = (R(2, 1) - R(1, 2)) * part, quaternion[2] = (R(0, 2) - R(2, 0)) * part, quaternion[3] = (R(1, 0) - R(0, 1)) * part;
  } else {
    const std::size_t i = largest - 1, j = largest % 3, k = (largest + 1) % 3;
    quaternion[0] = (R(k, j) - R(j, k)) * part, quaternion[1 + j] = (R(j, i) + R(i, j)) * part, quaternion[1 + k] = (R(k, i) + R(i, k)) * part;
  }
  quaternion[largest] = 0.5 * root;
  if (quaternion[0] < 0.0)
    for (std::size_t i = 0; i < 4; ++i) quaternion[i] = -quaternion[i];
}

/// A checked simulation with poses, each a `Pose` of C: position, attitude, velocity, angular_velocity, point.
template <class Base, class Pose, std::size_t count>
class WithPoses : public Base {
 public:
  std::array<Pose, count> found{};

  static const Pose* poses(WithPoses* s) {
    if (!Base::holds_one(s)) return nullptr;
    std::array<double, numbers_per_pose * count> numbers;
    s->sim.pose(numbers.data());
    const double* next = numbers.data();
    const auto take = [&next](double* to, std::size_t length) {
      for (std::size_t i = 0; i < length; ++i) to[i] = *next++;
    };
    for (Pose& pose : s->found) {
      take(pose.position, 3);
      quaternion_of(next, pose.attitude);
      next += 9;
      take(pose.velocity, 3);
      take(pose.angular_velocity, 3);
      take(pose.point, 3);
    }
    return s->found.data();
  }
};

}  // namespace cutjoint
