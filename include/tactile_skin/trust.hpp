// Decide whether a planner may act on a grasp now, with the rules of tactile_node/grasp/trust.py, for planners in C++.
// Both implementations are tested with the cases in test/trust_cases.yaml.
//
//   const auto doubt = tactile_skin::doubt(*grasp, (steady.now() - arrival).seconds());
//   if (doubt != tactile_skin::Doubt::NONE) { wait(tactile_skin::name_of(doubt)); }
#ifndef TACTILE_SKIN__TRUST_HPP_
#define TACTILE_SKIN__TRUST_HPP_

#include <cmath>

namespace tactile_skin
{

constexpr double MAX_AGE = 0.3;      // largest age of an acquisition [s]
constexpr double MAX_SILENCE = 0.1;  // largest time since the latest grasp arrived [s]

// Reason why a planner must not act on a grasp. If several reasons apply, the first one in this order is returned.
enum class Doubt
{
  NONE,        // the planner may act on the grasp
  SILENT,      // no grasp has arrived for too long, perhaps because the publisher has ended
  OLD,         // the acquisition is too old, or its age is not known
  NOT_KNOWN,   // a side has no result yet
  UNSEEN,      // a side is unseen and must never be treated as empty
  NO_CONTACT,
  ONE_SIDED,
  NOT_FRESH,
  BOUND,       // a contact may extend beyond the visible taxels, so its true centre may differ
  NOT_STABLE,
  NO_CENTRE    // the centre or the offset is NaN
};

inline const char * name_of(Doubt doubt)
{
  constexpr const char * names[] = {"none", "silent", "old", "not_known", "unseen", "no_contact", "one_sided",
    "not_fresh", "bound", "not_stable", "no_centre"};
  return names[static_cast<int>(doubt)];
}

// Grasp is tactile_skin::msg::Grasp, or a type with the same fields. silence is the time since the grasp arrived,
// measured with a steady clock [s].
template<class Grasp>
Doubt doubt(
  const Grasp & grasp, double silence, double max_age = MAX_AGE, double max_silence = MAX_SILENCE)
{
  if (!(silence >= 0.0 && silence <= max_silence)) {return Doubt::SILENT;}
  const double age = grasp.age.sec + 1e-9 * grasp.age.nanosec;  // at least 2^31 - 1 s if the age is not known
  if (!(age >= 0.0 && age + silence <= max_age)) {return Doubt::OLD;}
  if (grasp.contact == Grasp::UNSEEN) {return Doubt::UNSEEN;}
  if (grasp.contact == Grasp::NO_CONTACT) {return Doubt::NO_CONTACT;}
  if (grasp.contact == Grasp::ONE_SIDED) {return Doubt::ONE_SIDED;}
  if (grasp.contact != Grasp::TWO_SIDED) {return Doubt::NOT_KNOWN;}
  if (!grasp.fresh) {return Doubt::NOT_FRESH;}
  if (grasp.line_is_bound) {return Doubt::BOUND;}
  if (!grasp.stable) {return Doubt::NOT_STABLE;}
  const bool has_place = std::isfinite(grasp.centre[0]) && std::isfinite(grasp.centre[1]) &&
    std::isfinite(grasp.offset);
  return has_place ? Doubt::NONE : Doubt::NO_CENTRE;
}

}  // namespace tactile_skin

#endif  // TACTILE_SKIN__TRUST_HPP_
