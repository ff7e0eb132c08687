"""A package of a user's own adds a command, by an entry point."""

from typer.testing import CliRunner

from drake_rnn.cli.commands import app

GROUP = "drake_rnn.commands"
PAYLOAD = '''
from typing import Annotated
import typer
from drake_rnn import InvalidInputError
from drake_rnn.cli.command import options


@options
class Weigh:
    """Print the weight of a payload."""

    mass: Annotated[float, typer.Argument(help="Mass [kg].")]
    gravity: Annotated[float, typer.Option(help="Gravity [m/s^2].")] = 9.81

    def run(self):
        if self.mass < 0.0:
            raise InvalidInputError(f"mass: must be at least 0 kg, not {self.mass:g}")
        print(f"{self.mass * self.gravity:.2f} N")
'''


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_an_installed_command_runs_is_listed_and_is_refused_like_any_other(install):
    install(GROUP, "payloads", "payload_commands", PAYLOAD, weigh="payload_commands:Weigh")
    assert run("weigh", 2).stdout == "19.62 N\n"
    assert run("weigh", 2, "--gravity", 1.62).stdout == "3.24 N\n"
    listed = run("--help").stdout
    assert "Commands of installed packages" in listed
    assert "Print the weight of a payload." in listed
    described = run("weigh", "--help").stdout
    assert "Mass [kg]." in described
    assert "completion" not in described
    assert run("wiegh").stderr.startswith("error no such command 'wiegh'; perhaps 'weigh' is meant")
    negative = run("weigh", "--", -1)
    assert (negative.exit_code, negative.stderr) == (
        2,
        "error mass: must be at least 0 kg, not -1\n",
    )
    unknown = run("weigh", 2, "--moon")
    assert unknown.exit_code == 2
    assert unknown.stderr.startswith("error no such option: --moon")


def test_a_command_that_cannot_be_loaded_is_told_and_the_others_work(install):
    install(GROUP, "broken", "broken_commands", "1 / 0\n", lift="broken_commands:Lift")
    install(
        GROUP,
        "other",
        "other_commands",
        PAYLOAD,
        weigh="other_commands:Weigh",
        put="other_commands:typer",
    )
    refused = run("lift")
    assert refused.exit_code == 2
    assert refused.stderr.startswith(
        "error command 'lift' of the package broken cannot be loaded: ZeroDivisionError"
    )
    assert (
        "is no class made by drake_rnn.cli.command.options with a method run" in run("put").stderr
    )
    listed = " ".join(run("--help").stdout.split())
    assert "command 'lift' of the package broken cannot be loaded" in listed
    assert "Print the weight of a payload." in listed


def test_a_name_stands_for_one_command(install):
    install(GROUP, "payloads", "payload_commands", PAYLOAD, weigh="payload_commands:Weigh")
    install(GROUP, "scales", "scale_commands", PAYLOAD, weigh="scale_commands:Weigh")
    install(GROUP, "takes", "take_commands", PAYLOAD, arms="take_commands:Weigh")
    refused = run("weigh", 2).stderr
    assert "command 'weigh' is offered by the package payloads and by the package scales" in refused
    listed = " ".join(run("--help").stdout.split())
    assert "arms not that of the package takes: the name is taken" in listed
    assert run("arms").exit_code == 0
