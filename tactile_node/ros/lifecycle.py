"""What rclpy's lifecycle nodes lack."""

from enum import IntEnum

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode


class PrimaryState(IntEnum):
    """The primary states of a lifecycle node; the codes are those of lifecycle_msgs/State and of SkinStatus."""

    NOT_KNOWN = State.PRIMARY_STATE_UNKNOWN
    UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
    INACTIVE = State.PRIMARY_STATE_INACTIVE
    ACTIVE = State.PRIMARY_STATE_ACTIVE
    FINALIZED = State.PRIMARY_STATE_FINALIZED


def reject_invalid_transitions(node: LifecycleNode) -> None:
    """Answer a request for a transition that the node's state does not allow with success = False.

    rclpy raises in its callback (RCLError: "Transition is not registered"), which would end the process; a lifecycle
    manager that repeats itself would do that.
    """
    service = next(service for service in node.services if service.srv_type is ChangeState)
    change = service.callback

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change(request, response)
        except RuntimeError as error:
            node.get_logger().error(f'change_state: expected a transition that the present state allows, got '
                                    f'{request.transition.label or request.transition.id} ({error}). '
                                    'Ask ~/get_available_transitions.')
            response.success = False
            return response
    service.callback = answer
