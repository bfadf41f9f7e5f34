#include "step/marker_message.h"

#include <cstring>

namespace smartmesh {

void CdrBytes::put(const std::string& text) {
  put(static_cast<std::uint32_t>(text.size() + 1));
  data_.insert(data_.end(), text.begin(), text.end());
  data_.push_back(0);
}

double* CdrBytes::room_for(std::size_t points) {
  align(sizeof(double));
  const std::size_t start = data_.size();
  data_.resize(start + 3 * points * sizeof(double));
  return reinterpret_cast<double*>(data_.data() + start);
}

void CdrBytes::start(std::uint32_t count) {
  data_.assign({0, 1, 0, 0});  // little-endian, no options
  put(count);
}

void put_marker(const MarkerStyle& style, std::int32_t id, MarkerAction action, const ShownPatch* patch,
                CdrBytes& bytes) {
  constexpr std::int32_t TRIANGLE_LIST = 11;
  bytes.put(style.sec), bytes.put(style.nanosec), bytes.put(style.frame), bytes.put(style.ns);
  bytes.put(id), bytes.put(TRIANGLE_LIST), bytes.put(static_cast<std::int32_t>(action));
  bytes.put(Vec3{0.0, 0.0, patch == nullptr ? 0.0 : style.lift}), bytes.put(Vec3{}), bytes.put(1.0);  // pose
  bytes.put(Vec3{1.0, 1.0, 1.0});                                                                     // scale
  for (float part : style.colour) bytes.put(part);
  bytes.put(std::int32_t{0}), bytes.put(std::uint32_t{0});  // lifetime
  bytes.put(std::uint8_t{1});                               // frame_locked
  const std::size_t triangles = patch == nullptr ? 0 : patch->near.size();
  bytes.put(static_cast<std::uint32_t>(3 * triangles));
  if (triangles > 0) {
    double* next = bytes.room_for(3 * triangles);
    for (std::int32_t k : patch->near)
      for (std::int32_t corner : patch->triangles[k]) {
        std::memcpy(next, &patch->points[corner], sizeof(Vec3));
        next += 3;
      }
  }
  bytes.put(std::uint32_t{0});                                                        // colors
  bytes.put(std::string());                                                           // texture_resource
  bytes.put(std::int32_t{0}), bytes.put(std::uint32_t{0}), bytes.put(std::string());  // texture.header
  bytes.put(std::string()), bytes.put(std::uint32_t{0});                              // texture.format, data
  bytes.put(std::uint32_t{0});                                                        // uv_coordinates
  bytes.put(std::string()), bytes.put(std::string());                                 // text, mesh_resource
  bytes.put(std::string()), bytes.put(std::uint32_t{0});                              // mesh_file
  bytes.put(std::uint8_t{0});                                                         // mesh_use_embedded_materials
}

}  // namespace smartmesh
