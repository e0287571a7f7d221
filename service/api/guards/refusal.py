"""How a guard says no."""

from starlette.types import Receive, Scope, Send

from service.api.answers.problems import ProblemError, problem_response


async def refuse(error: ProblemError, scope: Scope, receive: Receive, send: Send) -> None:
    """Answers a request in place of the app: what middleware raises, no handler of the app would see."""
    await problem_response(scope["path"], error)(scope, receive, send)
