// The bodies in the bytes of a message of body states.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace smartmesh {

// Bytes of a message after its header, in CDR: texts are aligned to 4 bytes, the fields after them to 8.
struct MessageBytes {
  const std::uint8_t* data;
  std::size_t size;
};

// Splits `count` bodies, which start at byte `at`, into their `names`, each closed by a zero, and the fields of `width`
// bytes after each name, written to `rows` (count, width). Returns false if the message is too short.
bool split_bodies(const MessageBytes& message, std::size_t at, std::size_t count, std::size_t width, std::uint8_t* rows,
                  std::string& names);

}  // namespace smartmesh
