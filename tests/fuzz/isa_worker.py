"""Computes what `check_bits.Levels` asks for, on the instruction set that the environment chooses; ends with its input."""

import sys

import fisherpoint as fp
from check_bits import numbers, receive, send

if __name__ == "__main__":
    while True:
        try:
            case, x0, u, dt, theta = receive(sys.stdin.buffer)
        except (EOFError, KeyboardInterrupt):
            break
        send(sys.stdout.buffer, numbers(case.model(), case, fp.Experiments(x0, u, dt), theta))
