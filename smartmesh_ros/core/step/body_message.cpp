#include "step/body_message.h"

#include <algorithm>

namespace smartmesh {

bool split_bodies(const MessageBytes& message, std::size_t at, std::size_t count, std::size_t width, std::uint8_t* rows,
                  std::string& names) {
  const std::uint8_t* data = message.data;
  for (std::size_t i = 0; i < count; ++i) {
    at = (at + 3) / 4 * 4;
    if (at > message.size || message.size - at < 4) return false;
    std::size_t length = 0;
    for (std::size_t k = 4; k-- > 0;) length = 256 * length + data[at + k];
    at += 4;
    if (length < 1 || message.size - at < length) return false;
    names.append(reinterpret_cast<const char*>(data + at), length - 1).push_back('\0');
    at = (at + length + 7) / 8 * 8;
    if (at > message.size || message.size - at < width) return false;
    std::copy_n(data + at, width, rows + i * width);
    at += width;
  }
  return true;
}

}  // namespace smartmesh
