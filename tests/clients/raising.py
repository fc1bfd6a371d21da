# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of clients share."""


def raises(kind, words, function, *arguments, **more):
    """Asserts that a call fails, with some words (a string, or several) in the message, which is returned."""
    words = (words,) if isinstance(words, str) else words
    try:
        function(*arguments, **more)
    except kind as problem:
        message = str(problem)
        assert all(word in message for word in words), message
        return message
    raise AssertionError('%s is accepted' % (words,))
