"""The command ``cosim``, whose imports Ctrl-C ends as it ends all that follows."""

import sys


def main() -> int:
    """Run the command; returns the exit code."""
    try:
        from cosim.cli.main import main as command

        return command()
    except KeyboardInterrupt:
        exec("")  # as cosim.cli.main tells
        print("cosim: interrupted.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
