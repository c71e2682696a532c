"""``python -m fisherpoint``: the command line, where no program of that name is on the path."""

from fisherpoint_command import main

main()
