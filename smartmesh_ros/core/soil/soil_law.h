// The Soil Contact Model of one sample: Bekker's pressure, elastic unloading, Mohr-Coulomb and Janosi-Hanamoto shear.
//
// Krenn and Hirzinger, SCM - a soil contact model for multi-body system simulations, 2009; Tasora and others, A
// deformable terrain model in multi-domain dynamics using elastoplastic constraints, 2019.
#pragma once

#include <algorithm>
#include <cmath>

namespace smartmesh {

// Parameters of a soil, in the order and the units of SoilType in soil/config.py; `friction`: tangent of its angle.
struct SoilType {
  double kphi, kc, exponent, cohesion, friction, shear, elastic, damping;
};

// A soil under a contact in a step. `modulus`: Bekker's, with the width of the contact. `drag`: damping over the
// duration of the step [Pa/m].
struct LoadedSoil {
  double modulus, exponent, elastic, drag, cohesion, friction, shear;
};

inline LoadedSoil under_load(const SoilType& soil, double width, double dt) {
  return {soil.kc / width + soil.kphi,
          soil.exponent,
          soil.elastic,
          soil.damping / dt,
          soil.cohesion,
          soil.friction,
          soil.shear};
}

// What a sample keeps of all loads so far. `plastic` [m]: sinkage that remains without load. `yielded` [Pa]: highest
// pressure.
struct Yield {
  double plastic, yielded;
};

// Returns the pressure [Pa] of soil at a `sinkage` [m]. Below the highest so far the soil is elastic; above it,
// Bekker's modulus * sinkage^exponent limits the elastic pressure.
inline double pressure_at(double sinkage, const Yield& before, const LoadedSoil& soil) {
  const double trial = soil.elastic * (sinkage - before.plastic);
  if (sinkage <= 0.0 || trial <= 0.0) return 0.0;
  if (trial <= before.yielded) return trial;
  return std::min(trial, std::max(before.yielded, soil.modulus * std::pow(sinkage, soil.exponent)));
}

// Returns the derivative of that pressure by the sinkage [Pa/m].
inline double stiffness_at(double sinkage, double pressure, const Yield& before, const LoadedSoil& soil) {
  if (pressure <= 0.0) return 0.0;
  if (pressure >= soil.elastic * (sinkage - before.plastic)) return soil.elastic;
  return std::min(soil.exponent * pressure / sinkage, soil.elastic);
}

// Returns what a sample keeps of a `pressure` at a `sinkage`.
inline Yield yield_after(double sinkage, double pressure, const Yield& before, const LoadedSoil& soil) {
  if (pressure <= 0.0 || soil.elastic * (sinkage - before.plastic) <= before.yielded) return before;
  return {std::max(before.plastic, sinkage - pressure / soil.elastic), std::max(before.yielded, pressure)};
}

// Returns the shear stress [Pa] after a shear `displacement` [m].
inline double shear_at(double pressure, double displacement, const LoadedSoil& soil) {
  if (pressure <= 0.0) return 0.0;
  return (soil.cohesion + pressure * soil.friction) * (1.0 - std::exp(-displacement / soil.shear));
}

}  // namespace smartmesh
