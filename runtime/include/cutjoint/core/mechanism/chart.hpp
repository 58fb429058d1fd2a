// Places of coordinates and of changes of formula, and times of samples.  Descriptions read this: it includes nothing.
#pragma once

namespace cutjoint {

/// How one joint's coordinates follow its speeds: `scalars` coordinates from `q` on, their rates from `v` on; a ball adds a unit
/// quaternion (scalar first) after the scalars and, after their rates, an angular velocity in the inner body's axes.  The quaternion takes
/// the follower's axes to the base's; of a `reversed` joint, whose inner body is the follower, the base's to the follower's.
struct Chart {
  int q;
  int v;
  int scalars;
  bool ball;
  bool reversed = false;
};

/// A value that is watched for a change of formula: the place along a `road`, or without a road a value that changes its sign.  The indicator
/// `across` has the place across the road; without one, the place is right of the middle.  Where it `is_continuous` forces only get another derivative.
struct IndicatorPlace {
  int road = -1;
  int across = -1;
  bool is_continuous = false;
};

/// A controller takes samples at `offset` + k `every`, s, and holds so many values in between.  `felt` has a letter for each, '0' of one that samples and
/// outputs alone read, so that no motion follows from it.  Samples of one that is `accelerated` read accelerations or multipliers.
struct SampleTimes {
  double every;
  double offset;
  int held;
  const char* felt;
  bool accelerated;
};

}  // namespace cutjoint
