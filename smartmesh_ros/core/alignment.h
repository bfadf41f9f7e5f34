// Check of arrays that come from Python.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>

namespace smartmesh {

// Refuses data that a processor may not read as numbers of `size` bytes, such as views of bytes at odd addresses.
inline void check_alignment(const void* data, std::size_t size) {
  if (reinterpret_cast<std::uintptr_t>(data) % size != 0)
    throw std::invalid_argument("arrays must be aligned; pass a copy");
}

}  // namespace smartmesh
