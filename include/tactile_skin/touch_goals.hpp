// How goals of touch_gripper ended, by their ids: the result says little, and the outcome is a message of its own
// that may come before it, also before the goal is accepted. As tactile_node/ros/touch_client.py, for planners in C++.
// Needs no rclcpp; docs/closing.md shows it with rclcpp. Not thread-safe: call it from one callback group.
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

constexpr double OUTCOME_WAIT = 1.0;       // after the result; then the outcome is taken for lost [s]
constexpr std::size_t MOST_GOALS = 16;     // that are kept; the oldest gives way

using GoalId = std::array<std::uint8_t, 16>;

// Outcome: tactile_skin::msg::GripperOutcome, or what has its fields goal_id and of_hold. Times are of a steady clock.
template<class Result, class Outcome>
class TouchGoals
{
public:
  struct Ending
  {
    Result result;
    std::optional<Outcome> outcome;  // none: it was lost
  };

  // Take the result of a goal, which arrived at `now` [s].
  void on_result(const GoalId & id, Result result, double now)
  {
    auto & goal = of(id, now);
    goal.result = std::move(result);
    goal.result_at = now;
  }

  // Take an outcome, of any goal; that of a hold is no ending of its goal, and is left out.
  void on_outcome(const Outcome & outcome, double now)
  {
    if (!outcome.of_hold) {of(outcome.goal_id, now).outcome = outcome;}
  }

  // Return how the goal ended, and forget it; none: it is under way.
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
    double since = 0.0;  // when anything was heard of it first [s]
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
