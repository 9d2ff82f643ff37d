"""`python -m jaxrot`: the commands."""

import argparse
import io
import sys
from collections.abc import Sequence
from typing import NoReturn

from jaxrot.console.errors import UserError
from jaxrot.recommending import command as recommending
from jaxrot.report import command as report
from jaxrot.simulate import command as simulate


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are one line, without the usage in front of them."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        arguments: The words of the command line; those of this process by default.

    Returns:
        The exit status: 0, or 2 where the user has something to mend, or 130 when interrupted.
    """
    parser = _Parser(prog="python -m jaxrot", description="Nearest rotations of 3x3 matrices.")
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
    options = parser.parse_args(arguments)
    try:
        return options.run(options)
    except UserError as error:
        print(f"{parser.prog} {options.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{parser.prog} {options.command}: interrupted, nothing written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no κ must not cost the user a report that took minutes.
        sys.stdout.reconfigure(errors="replace")
    sys.exit(main())
