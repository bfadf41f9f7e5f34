#include "map/blending.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

double instant_of_update(double time, double delay, double shown, double most) {
  return std::abs(shown - time) <= most ? shown : time + delay;
}

void set_blend(Clock& clock, double since, const MotionRules& rules) {
  clock.since = since;
  clock.until = rules.mode == Mode::Interpolate ? std::max(clock.time + clock.delay, since) + clock.lifetime
                                                : since + rules.smoothing * clock.lifetime;
}

ShownGround::ShownGround(const HeightGrid& grid, const Span& rows, const Span& columns, double instant)
    : rows_(rows), columns_(columns), instant_(instant) {
  const std::ptrdiff_t count = columns.last - columns.first;
  heights_.resize(static_cast<std::size_t>((rows.last - rows.first) * count)), rises_.resize(heights_.size());
  GridReader reader(grid, instant, READ_OVER);
  for (std::ptrdiff_t r = rows.first; r < rows.last; ++r) {
    const std::ptrdiff_t k = (r - rows.first) * count;
    read(reader, r, &heights_[k], &rises_[k]);
  }
}

void ShownGround::read(GridReader& reader, std::ptrdiff_t row, double* heights, double* rises) const {
  const int r = static_cast<int>(row), c = static_cast<int>(columns_.first);
  const int count = static_cast<int>(columns_.last - columns_.first);
  reader.read_row(r, c, count, heights, rises);
}

void ShownGround::write_deviations(HeightGrid& map) const {
  const std::ptrdiff_t count = columns_.last - columns_.first;
  std::vector<double> heights(static_cast<std::size_t>(count)), rises(heights.size());
  GridReader reader(map, instant_, READ_OVER);
  for (std::ptrdiff_t r = rows_.first; r < rows_.last; ++r) {
    float *offsets = map.offsets + r * map.columns, *rates = map.rates + r * map.columns;
    std::fill(offsets + columns_.first, offsets + columns_.last, 0.0f);
    std::fill(rates + columns_.first, rates + columns_.last, 0.0f);
    read(reader, r, heights.data(), rises.data());
    const double *shown = &heights_[(r - rows_.first) * count], *shown_rise = &rises_[(r - rows_.first) * count];
    for (std::ptrdiff_t c = columns_.first, end; c < columns_.last; c = end) {
      end = std::min(block_span(c >> BLOCK_SHIFT, map.columns).last, columns_.last);
      const Clock& clock = map.clock(static_cast<int>(r), static_cast<int>(c));
      if (clock.known == 0) continue;
      const float* newest = map.velocities + (clock.newest * map.rows + r) * map.columns;
      for (std::ptrdiff_t i = c; i < end; ++i) {
        const std::ptrdiff_t k = i - columns_.first;
        const double offset = shown[k] - heights[k], rate = (shown_rise[k] - rises[k]) * (1.0 / READ_OVER);
        const bool moves = (std::abs(static_cast<double>(newest[i])) <= map.max_velocity) & (offset == offset);
        offsets[i] = moves ? static_cast<float>(offset) : 0.0f;
        rates[i] = moves ? static_cast<float>(rate) : 0.0f;
      }
    }
  }
}

}  // namespace smartmesh
