// Whether a grasp may be acted on now: the rules of tactile_node/grasp/trust.py, for planners in C++.
// Both are tested with the cases of test/trust_cases.yaml.
//
//   const auto doubt = tactile_skin::doubt(*grasp, (steady.now() - arrival).seconds());
//   if (doubt != tactile_skin::Doubt::NONE) { wait(tactile_skin::name_of(doubt)); }
#ifndef TACTILE_SKIN__TRUST_HPP_
#define TACTILE_SKIN__TRUST_HPP_

#include <cmath>

namespace tactile_skin
{

constexpr double MAX_AGE = 0.3;      // of an acquisition [s]
constexpr double MAX_SILENCE = 0.1;  // since the latest grasp arrived [s]

// Why a grasp must not be acted on: the first that holds, in this order.
enum class Doubt
{
  NONE,        // it may
  SILENT,      // no grasp for too long: the publisher may have ended
  OLD,         // its acquisition, or its age is not known
  NOT_KNOWN,   // a side has no result yet
  UNSEEN,      // never take it for empty
  NO_CONTACT,
  ONE_SIDED,
  NOT_FRESH,
  BOUND,       // a contact may reach beyond what is seen: its centre is another one
  NOT_STABLE,
  NO_CENTRE    // NaN
};

inline const char * name_of(Doubt doubt)
{
  constexpr const char * names[] = {"none", "silent", "old", "not_known", "unseen", "no_contact", "one_sided",
    "not_fresh", "bound", "not_stable", "no_centre"};
  return names[static_cast<int>(doubt)];
}

// Grasp: tactile_skin::msg::Grasp, or what has its fields. silence: since it arrived, by a steady clock [s].
template<class Grasp>
Doubt doubt(
  const Grasp & grasp, double silence, double max_age = MAX_AGE, double max_silence = MAX_SILENCE)
{
  if (!(silence >= 0.0 && silence <= max_silence)) {return Doubt::SILENT;}
  const double age = grasp.age.sec + 1e-9 * grasp.age.nanosec;  // 2^31 - 1 s and more: not known
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
