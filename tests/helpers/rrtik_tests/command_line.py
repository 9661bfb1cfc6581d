"""The command line in this process."""

from rrtik_ompl.cli.app import run


def rrtik(capsys, *arguments):
    """Exit code, standard output and standard error of `rrtik` with these arguments."""
    code = run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err
