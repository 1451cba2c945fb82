"""Ctrl-C, for the examples in this folder."""

import atexit
import signal
import threading
import time

# Signals that follow the first within this time repeat it.
REPEATS_FOR_S = 1.0


def interrupted_once(raises=False):
    """Has SIGINT and SIGTERM interrupt the program once. Returns an event that the first sets; it `raises` KeyboardInterrupt
    as well.

    A program that `ros2 launch` started receives Ctrl-C twice: from the terminal and from `ros2 launch`. What comes within a
    second of the first changes nothing, and a later signal ends the program at once. Give `rclpy.init`
    `SignalHandlerOptions.NO`: its own handlers end the context while callbacks still publish.
    """
    interrupted = threading.Event()
    first = 0.0

    def handle(number, _frame):
        nonlocal first
        now = time.monotonic()
        if not interrupted.is_set():
            first = now
            interrupted.set()
            if raises:
                raise KeyboardInterrupt
        elif now - first > REPEATS_FOR_S:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handle)
        # An interpreter that ends would let the default action have the signal, which kills it.
        atexit.register(signal.signal, number, signal.SIG_IGN)
    return interrupted
