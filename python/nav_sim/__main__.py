"""The command `nav-sim`: the same program as the one built without Python."""

from __future__ import annotations

import sys


def main() -> int:
    """Does what the words of the command line ask for, and returns the exit code."""
    # neither numpy nor the functions: the command starts at once
    from nav_sim import _native

    return _native.main(["nav-sim", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
