"""The first import of the process that workers are forked from: Ctrl-C ends it at once and silently.

Its imports take a second or more, in which Python's own answer to Ctrl-C would be a traceback. Once they
are done, multiprocessing has it ignore Ctrl-C.
"""

from __future__ import annotations

import signal
import sys

if any("multiprocessing.forkserver" in argument for argument in sys.orig_argv):
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
