"""The command line as a program: ``dualbend``, and ``python -m dualbend``."""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    # Until there is a command that can say it in a line, Ctrl-C ends the process, without a
    # traceback through half an import.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from dualbend.cli import main

if __name__ == "__main__":
    main()
