#include "bullet/memory.h"

namespace smartmesh {

namespace {

// Numbers of a part on the soil before those of its rim.
struct PartMemory {
  double number, near;  // `near`: it was near the soil in the last step
  SoilPartMemory part;
  double rim;  // how many numbers it has
};
constexpr std::size_t PART = sizeof(PartMemory) / sizeof(double);

}  // namespace

std::vector<double> parts_memory(const Slot& slot, const SoilInStep* soil) {
  std::vector<double> found;
  if (soil == nullptr) return found;
  for (const auto& [number, part] : slot.on_soil) {
    std::vector<double> rim;
    part.rim.write(rim);
    const PartMemory memory{static_cast<double>(number), static_cast<double>(soil->was_near(part)), part,
                            static_cast<double>(rim.size())};
    const auto* numbers = reinterpret_cast<const double*>(&memory);
    found.insert(found.end(), numbers, numbers + PART);
    found.insert(found.end(), rim.begin(), rim.end());
  }
  return found;
}

bool recall_parts(Slot& slot, const SoilInStep* soil, const double* numbers, std::size_t count) {
  if (slot.object == nullptr || soil == nullptr) return count == 0;
  slot.find_leaves();
  SoilParts parts;
  while (count > 0) {
    if (count < PART) return false;
    const PartMemory memory = *reinterpret_cast<const PartMemory*>(numbers);
    if (!(memory.number >= 0.0 && memory.number < slot.leaves.size() && memory.rim >= 0.0 &&
          memory.rim <= static_cast<double>(count - PART)))
      return false;
    const auto rim = static_cast<std::size_t>(memory.rim);
    const int number = static_cast<int>(memory.number);
    const Convex* convex = slot.convex_of_part(*slot.leaves[number]);
    SoilPart& part = parts[number];
    if (convex == nullptr || !part.rim.read(numbers + PART, rim)) return false;
    part.shape = pressing_shape(*convex);
    part.step = memory.near != 0.0 ? soil->step() - 1 : -1;
    static_cast<SoilPartMemory&>(part) = memory.part;
    numbers += PART + rim, count -= PART + rim;
  }
  slot.on_soil = std::move(parts);
  return true;
}

}  // namespace smartmesh
