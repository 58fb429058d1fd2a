// Indices of coordinates and event indicators, and sample times.  Descriptions include this; it includes nothing.
#pragma once

namespace cutjoint {

/// Coordinates and velocities of one joint: `scalars` coordinates from `q` on, their rates from `v` on; a ball adds a unit
/// quaternion (scalar first) after the scalars and, after their rates, an angular velocity in the inner body's axes.  The quaternion takes
/// the follower's axes to the base's; of a `reversed` joint, whose inner body is the follower, the base's to the follower's.
struct Chart {
  int q;
  int v;
  int scalars;
  bool ball;
  bool reversed = false;
};

/// An event indicator: the position along a `road`, or without a road a value that changes sign at the event.  The indicator `across` has the lateral
/// position; without one it is right of the middle.  If `is_continuous`, forces are continuous at the event and only their derivatives jump.
struct IndicatorPlace {
  int road = -1;
  int across = -1;
  bool is_continuous = false;
};

/// A controller takes samples at `offset` + k `every`, s, and holds `discrete` states in between.  `affects` has a digit for each: 1 if the motion
/// depends on it, plus 2 if later controllers read it in samples at the same time.  Samples of a controller that is `accelerated` read accelerations or multipliers.
struct SampleTimes {
  double every;
  double offset;
  int discrete;
  const char* affects;
  bool accelerated;
};

}  // namespace cutjoint
