// A road that a host sets at run time: line segments, equal for both sides, and a surface on them.
#pragma once

#include "cutjoint/core/roads/road.hpp"

namespace cutjoint {

/// A road of at most `most` lines.
template <std::size_t Most>
class LaidRoad {
 public:
  /// Set lines in the order of x, each given by the x of its beginning, its height there and its slope, and heights on a grid that repeats
  /// along x, which the host owns: `grid` is the first x and y, and the spacing.  False if there are too many lines.
  bool lay(const double* lines, int count, const double* grid, const double* heights, int along, int across) {
    if (count < 1 || static_cast<std::size_t>(count) > Most || along < 0 || across < 0 || (along > 0 && (along < 4 || across < 2))) return false;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      pieces_[i] = {PieceKind::line, lines[3 * i], lines[3 * i + 1], lines[3 * i + 2], 0.0};
      begins_[i] = lines[3 * i];
    }
    count_ = static_cast<std::size_t>(count);
    surface_ = {};
    if (along > 0)
      surface_.field = {.start = {grid[0], grid[1]}, .step = {grid[2], grid[3]}, .counts = {along, across}, .wraps = true, .bilinear = false,
                        .heights = {heights, static_cast<std::size_t>(along) * static_cast<std::size_t>(across)}};
    return true;
  }

  /// The road for point followers.
  Road<double> road() const {
    const Track<double> track{.pieces = {pieces_.data(), count_}, .breaks = {begins_.data() + 1, count_ - 1}};
    return {track, track, false, &surface_};
  }

 private:
  std::array<Piece<double>, Most> pieces_{};
  std::array<double, Most> begins_{};
  std::size_t count_ = 0;
  Surface<double> surface_{};
};

}  // namespace cutjoint
