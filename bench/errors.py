"""The one exception whose message is written for the user."""


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message is one sentence that says what is wrong, where (file and line, or the nearest valid
    name) and what to do. The command line prints it without a traceback and exits with code 2.
    """
