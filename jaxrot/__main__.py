"""`python -m jaxrot`: the commands."""

import io
import os
import signal
import sys
from collections.abc import Sequence

from jaxrot._startup import INTERRUPTED
from jaxrot.console.arguments import Parser
from jaxrot.console.errors import UnreadError, UserError
from jaxrot.console.interrupts import Interrupts, watched
from jaxrot.console.printing import complain
from jaxrot.recommending import command as recommending
from jaxrot.report import command as report
from jaxrot.simulate import command as simulate

_PROGRAM = "python -m jaxrot"
# 128 + SIGPIPE: what a shell reports of cat or grep when nobody reads the pipe that they write to. They end quietly.
_UNREAD = 141


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        arguments: The words of the command line; those of this process by default.

    Returns:
        The exit status: 0; 2 for something that the user can fix; 130 after Ctrl-C; 141 where standard output is a pipe
        that nobody reads any more.
    """
    name = _PROGRAM
    with watched(owns_process=arguments is None) as interrupts:
        try:
            options = _parser().parse_args(arguments)
            name = f"{_PROGRAM} {options.command}"
            return options.run(options, interrupts)
        except UnreadError:
            return _UNREAD
        except (Exception, KeyboardInterrupt) as error:
            if _is_interruption(error, interrupts):
                complain(f"{name}: interrupted, nothing written")
                return INTERRUPTED
            if not isinstance(error, UserError):
                raise
            complain(f"{name}: {error}")
            return 2


def _is_interruption(error: BaseException, interrupts: Interrupts) -> bool:
    # Code that an interruption passes through may turn it into an error of its own, such as an ImportError.
    return isinstance(error, KeyboardInterrupt) or (interrupts.pending and not interrupts.has_results)


def _parser() -> Parser:
    parser = Parser(prog=_PROGRAM, description="Nearest rotations of 3x3 matrices.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    report_parser = commands.add_parser("report", help="measure error against run time of every method")
    report.add_arguments(report_parser)
    report_parser.set_defaults(run=report.run)
    recommend_parser = commands.add_parser("recommend", help="the cheapest method for a file of matrices")
    recommending.add_arguments(recommend_parser)
    recommend_parser.set_defaults(run=recommending.run)
    simulate_parser = commands.add_parser("simulate", help="run a scene, animate it and watch its health")
    simulate.add_arguments(simulate_parser)
    simulate_parser.set_defaults(run=simulate.run)
    return parser


if __name__ == "__main__":
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no κ must not cost the user a report that took minutes.
        sys.stdout.reconfigure(errors="replace")
    try:
        status = main()
    finally:
        # The command is over. A Ctrl-C while Python shuts down would only add a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if status == INTERRUPTED:
        # XLA may crash while Python shuts down, if an exception has ended a compilation. All output is flushed.
        os._exit(status)
    sys.exit(status)
