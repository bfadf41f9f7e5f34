// Taking updates of a moving mesh: new vertices, and velocities estimated from them.
#include <algorithm>
#include <cmath>

#include "map/blending.h"
#include "mesh/mesh_reader.h"

namespace smartmesh {

namespace {

std::vector<Vertex> read_all(const MeshSurface& mesh, double time) {
  const MeshReader reader(mesh, time, READ_OVER);
  std::vector<Vertex> found;
  found.reserve(static_cast<std::size_t>(mesh.vertices));
  for (int v = 0; v < mesh.vertices; ++v) found.push_back(reader.read(v));
  return found;
}

// Writes the newest velocities, and the positions.
void write(MeshSurface& mesh, const NewVertices& fresh, const VelocityUpdate& update) {
  const std::ptrdiff_t vertices = mesh.vertices;
  double* velocities = mesh.velocities.data() + mesh.clock.newest * 3 * vertices;
  if (fresh.velocities == nullptr)
    for (std::ptrdiff_t i = 0; i < 3 * vertices; ++i) velocities[i] *= update.keep;
  for (std::ptrdiff_t axis = 0; axis < 3; ++axis) {
    for (std::ptrdiff_t k = 0; k < fresh.count; ++k) {
      const std::ptrdiff_t from = axis * fresh.count + k;
      const std::ptrdiff_t i = axis * vertices + (fresh.chosen == nullptr ? k : fresh.chosen[k]);
      if (fresh.velocities != nullptr)
        velocities[i] = fresh.velocities[from];
      else
        velocities[i] += (fresh.positions[from] - mesh.now[i]) * update.inverse;
      mesh.now[i] = fresh.positions[from];
    }
  }
}

// Writes the deviations of what was `shown` at an `instant` from the motion after the update.
void write_deviations(MeshSurface& mesh, const std::vector<Vertex>& shown, double instant) {
  const std::vector<Vertex> now = read_all(mesh, instant);
  const double* newest = mesh.velocities.data() + mesh.clock.newest * 3 * mesh.vertices;
  for (int v = 0; v < mesh.vertices; ++v) {
    const Vec3 off = shown[v].position - now[v].position,
               rate = (shown[v].displacement - now[v].displacement) * (1.0 / READ_OVER);
    const double offs[3] = {off.x, off.y, off.z}, rates[3] = {rate.x, rate.y, rate.z};
    for (int axis = 0; axis < 3; ++axis) {
      const std::ptrdiff_t i = static_cast<std::ptrdiff_t>(axis) * mesh.vertices + v;
      if (!(std::abs(newest[i]) <= mesh.max_velocity)) continue;  // a jump
      mesh.offsets.data()[i] = offs[axis], mesh.rates.data()[i] = rates[axis];
    }
  }
}

}  // namespace

void take_vertices(MeshSurface& mesh, const NewVertices& fresh, const Intervals& intervals) {
  Clock& clock = mesh.clock;
  const std::ptrdiff_t size = 3 * static_cast<std::ptrdiff_t>(mesh.vertices), newest = clock.newest;
  const double instant = instant_of_update(fresh.time, clock.delay, mesh.shown, intervals.most);
  std::vector<Vertex> shown;
  if (mesh.blends()) shown = read_all(mesh, instant);
  const VelocityUpdate update =
      note_update(clock, fresh.time, fresh.velocities != nullptr, fresh.chosen == nullptr, intervals);
  set_blend(clock, instant, mesh);
  if (clock.newest != newest) std::fill_n(mesh.velocities.data() + clock.newest * size, size, 0.0);
  write(mesh, fresh, update);
  if (mesh.blends()) std::fill_n(mesh.offsets.data(), size, 0.0), std::fill_n(mesh.rates.data(), size, 0.0);
  mesh.update();
  if (!mesh.blends() || clock.known == 0) return;
  write_deviations(mesh, shown, instant);
  mesh.measure();
}

}  // namespace smartmesh
