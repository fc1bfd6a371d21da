# SPDX-License-Identifier: BSD-3-Clause
"""Answers with a proof, from the program tetlod: `Stream.ask`, and what `testing` compares."""
from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple, Type, Union

from ._sources import Memory, Remote, Source
from ._words import speak


@dataclass(frozen=True)
class Answer:
    """What is certain of a question about the original: its answer is from `lower` to `upper`.

    bound: 'exact' (but for rounding) or 'certified'. level: that says so; None for the index. bytes: that are read for
    it.
    answer: of a predicate ('max(T) < 500') 'yes', 'no' or 'unknown'; None of others. time: of a step of a series.
    """
    question: str
    lower: float
    upper: float
    unit: str
    bound: str
    level: Optional[int]
    bytes: int
    answer: Optional[str] = None
    time: Optional[float] = None


def find_program() -> str:
    """$TETLOD, or `tetlod` of the PATH."""
    command = os.environ.get('TETLOD') or shutil.which('tetlod')
    if not command:
        raise FileNotFoundError('the program tetlod is not installed (or name it: $TETLOD)')
    return command


def run(arguments: Sequence[str]) -> Tuple[int, Dict[str, Any]]:
    """Exit status and answer of a command with --json."""
    done = subprocess.run([find_program(), *arguments, '--json'], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)
    if done.returncode in (0, 4, 5):
        found: Dict[str, Any] = json.loads(done.stdout)
        return done.returncode, found
    message = speak(done.stderr.decode('utf-8', 'replace'))
    kind: Type[Exception] = ValueError if done.returncode in (2, 3) else OSError
    raise kind(message or 'tetlod %s failed with status %d' % (arguments[0], done.returncode))


def chosen_step(time: Union[float, Sequence[float], None], step: Union[int, Sequence[int], None]) -> List[str]:
    """The options of a step; of two results one for both, or one for each."""
    given = []
    for name, value in (('--time', time), ('--step', step)):
        if value is not None:
            both = value if isinstance(value, (list, tuple)) else [value]
            given += [name, ','.join(repr(one) for one in both)]
    return given


def ask(source: Source, question: str, within: Union[float, str, None], time: Optional[float],
        step: Optional[int]) -> Answer:
    options = chosen_step(time, step) + ([] if within is None else ['--within', str(within)])
    if isinstance(source, Memory):
        with tempfile.TemporaryDirectory(prefix='tetlod-') as folder:
            place = os.path.join(folder, 'stream.tetlod')
            with open(place, 'wb') as file:
                file.write(source.data)
            return answer_of(run(['ask', place, question, *options])[1])
    if source.headers or not isinstance(source.location, (str, bytes)):
        raise ValueError('ask reads a path, bytes or a URL without headers of its own, as the program does')
    place = source.url if isinstance(source, Remote) else source.name
    return answer_of(run(['ask', place, question, *options])[1])


def answer_of(found: Dict[str, Any]) -> Answer:
    return Answer(found['question'], found['lower'], found['upper'], found['unit'], found['bound'], found.get('level'),
                  found['bytes'], found.get('answer'), found.get('time'))
