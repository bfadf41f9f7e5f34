#include "soil_balance.h"

namespace smartmesh {

namespace {

// Most rounds of the search for the sinkage. Newton's method needs three to six; bisection is the fallback.
constexpr int ROUNDS = 40;
// Most rounds, and halvings of a step, of the search for the lean.
constexpr int LEAN_ROUNDS = 4, HALVINGS = 2;
// Relative errors of the carried force and moments at which the searches end.
constexpr double LOAD_ERROR = 1e-5, MOMENT_ERROR = 1e-3;

// What the soil's force and moments lack [N], and their derivatives by the lean [N/m], which are symmetric.
struct Lack {
  double force, x, y;
  double ff = 0.0, fx = 0.0, fy = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;

  double worst() const { return std::max(std::max(std::abs(force), std::abs(x)), std::abs(y)); }
};

void try_lean(std::vector<UnderSample>& samples, const Lean& lean, double dt) {
  for (UnderSample& sample : samples)
    if (sample.area > 0.0) sample.load = load_at(sample, lean, dt);
}

Lack lack_of(std::vector<UnderSample>& samples, const Wanted& wanted, const Lean& lean, double dt) {
  try_lean(samples, lean, dt);
  Lack lack{wanted.load, wanted.moment_x, wanted.moment_y};
  for (const UnderSample& sample : samples) {
    const double area = sample.area, x = sample.x, y = sample.y;
    if (!(area > 0.0)) continue;
    const double force = area * sample.load.total, slope = area * sample.load.stiffness;
    lack.force -= force, lack.x -= force * x, lack.y -= force * y;
    lack.ff += slope, lack.fx += slope * x, lack.fy += slope * y;
    lack.xx += slope * x * x, lack.xy += slope * x * y, lack.yy += slope * y * y;
  }
  return lack;
}

// Writes the step that makes up for a lack, by Cramer's rule; false if the matrix is nearly singular.
bool solve(const Lack& a, Lean& step) {
  const double c00 = a.xx * a.yy - a.xy * a.xy, c01 = a.xy * a.fy - a.fx * a.yy, c02 = a.fx * a.xy - a.xx * a.fy;
  const double determinant = a.ff * c00 + a.fx * c01 + a.fy * c02;
  if (!(determinant > 1e-9 * (a.ff * a.ff * a.ff))) return false;
  const double c11 = a.ff * a.yy - a.fy * a.fy, c12 = a.fx * a.fy - a.ff * a.xy, c22 = a.ff * a.xx - a.fx * a.fx;
  step = {(c00 * a.force + c01 * a.x + c02 * a.y) / determinant, (c01 * a.force + c11 * a.x + c12 * a.y) / determinant,
          (c02 * a.force + c12 * a.x + c22 * a.y) / determinant};
  return true;
}

double limited(double value, double most) { return std::min(std::max(value, -most), most); }

}  // namespace

double balance(std::vector<UnderSample>& samples, double load, const Lean& lean, double deepest, double dt) {
  double trial = lean.down, low = trial, high = deepest;
  for (const UnderSample& sample : samples)  // the highest place, at which the body touches nothing
    low = std::min(low, pressed_to(sample, {0.0, lean.x, lean.y}) - sample.level);
  for (int round = 0; round < ROUNDS; ++round) {
    try_lean(samples, {trial, lean.x, lean.y}, dt);
    double force = 0.0, slope = 0.0;
    for (const UnderSample& sample : samples) {
      if (!(sample.area > 0.0)) continue;
      force += sample.area * sample.load.total;
      slope += sample.area * sample.load.stiffness;
    }
    if (std::abs(force - load) <= LOAD_ERROR * load) return trial;
    (force < load ? low : high) = trial;
    if (high - low <= 1e-12) return trial;
    trial = slope > 0.0 ? trial + (load - force) / slope : high;
    if (!(low < trial && trial < high)) trial = 0.5 * (low + high);
  }
  try_lean(samples, {trial, lean.x, lean.y}, dt);
  return trial;
}

bool lean_over(std::vector<UnderSample>& samples, const Wanted& wanted, double dt, Lean& lean) {
  Lack lack = lack_of(samples, wanted, lean, dt);
  for (int round = 0; round < LEAN_ROUNDS; ++round) {
    const double worst = lack.worst() / wanted.load;
    if (worst <= MOMENT_ERROR) return true;
    Lean step;
    if (!solve(lack, step)) return false;
    bool better = false;
    for (int halving = 0; halving < HALVINGS && !better; ++halving) {
      const Lean trial{std::min(lean.down + step.down, wanted.deepest), limited(lean.x + step.x, wanted.most),
                       limited(lean.y + step.y, wanted.most)};
      const Lack found = lack_of(samples, wanted, trial, dt);
      better = found.worst() / wanted.load < worst;
      if (better) lack = found, lean = trial;
      else step = {0.5 * step.down, 0.5 * step.x, 0.5 * step.y};
    }
    if (!better) return false;
  }
  return lack.worst() / wanted.load <= MOMENT_ERROR;
}

}  // namespace smartmesh
