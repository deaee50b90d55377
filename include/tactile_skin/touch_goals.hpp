// Matches the results and the outcomes of touch_gripper goals by the goal id, for planners in C++. The result of a goal
// contains little information. Its outcome is a separate message, which may arrive before the result, and even before
// the goal is accepted. tactile_node/gripper/touch_client.py does the same in Python.
// The header does not need rclcpp; docs/closing.md shows an example with rclcpp. The class is not thread-safe, so call
// it from one callback group.
//
//   tactile_skin::TouchGoals<Result, tactile_skin::msg::GripperOutcome> goals;
//   goals.on_outcome(outcome, now); goals.on_result(result.goal_id, result, now);
//   if (const auto ending = goals.take(goal_id, now)) { ... }
#ifndef TACTILE_SKIN__TOUCH_GOALS_HPP_
#define TACTILE_SKIN__TOUCH_GOALS_HPP_

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

namespace tactile_skin
{

constexpr double OUTCOME_WAIT = 1.0;       // time after the result until the outcome counts as lost [s]
constexpr std::size_t MOST_GOALS = 16;     // number of goals kept; a new goal replaces the oldest

using GoalId = std::array<std::uint8_t, 16>;

// Outcome is tactile_skin::msg::GripperOutcome, or a type with the same fields goal_id and of_hold. All times come from
// a steady clock.
template<class Result, class Outcome>
class TouchGoals
{
public:
  struct Ending
  {
    Result result;
    std::optional<Outcome> outcome;  // empty if the outcome was lost
  };

  // Store the result of a goal, which arrived at `now` [s].
  void on_result(const GoalId & id, Result result, double now)
  {
    auto & goal = of(id, now);
    goal.result = std::move(result);
    goal.result_at = now;
  }

  // Store the outcome of any goal. The outcome of a hold does not end a goal and is ignored.
  void on_outcome(const Outcome & outcome, double now)
  {
    if (!outcome.of_hold) {of(outcome.goal_id, now).outcome = outcome;}
  }

  // Return how the goal ended, and forget the goal. Return nullopt while the goal is in progress.
  std::optional<Ending> take(const GoalId & id, double now)
  {
    const auto found = goals_.find(id);
    if (found == goals_.end() || !found->second.result) {return std::nullopt;}
    if (!found->second.outcome && now - found->second.result_at <= OUTCOME_WAIT) {return std::nullopt;}
    Ending ending{std::move(*found->second.result), std::move(found->second.outcome)};
    goals_.erase(found);
    return ending;
  }

private:
  struct Goal
  {
    double since = 0.0;  // arrival time of the first message about the goal [s]
    double result_at = 0.0;
    std::optional<Result> result;
    std::optional<Outcome> outcome;
  };

  Goal & of(const GoalId & id, double now)
  {
    const auto found = goals_.find(id);
    if (found != goals_.end()) {return found->second;}
    if (goals_.size() >= MOST_GOALS) {
      auto oldest = goals_.begin();
      for (auto each = goals_.begin(); each != goals_.end(); ++each) {
        if (each->second.since < oldest->second.since) {oldest = each;}
      }
      goals_.erase(oldest);
    }
    auto & goal = goals_[id];
    goal.since = now;
    return goal;
  }

  std::map<GoalId, Goal> goals_;
};

}  // namespace tactile_skin

#endif  // TACTILE_SKIN__TOUCH_GOALS_HPP_
