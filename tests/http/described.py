# SPDX-License-Identifier: BSD-3-Clause
"""Holds answers against the description that server/api/describe.py makes: the status, every header and every member of
an answer must be described there."""
import json
import os
import re
import sys
import urllib.parse

import jsonschema

sys.path.insert(0, os.path.join(os.environ['ROOT'], 'server', 'api'))
import describe  # noqa: E402

DOCUMENT = json.loads(json.dumps(describe.document()))
# Headers that HTTP itself needs; OpenAPI describes Content-Type as the name of the content
OF_HTTP = {'connection', 'content-length', 'content-type', 'date'}


def resolve(value):
    """What a reference leads to, or the value itself."""
    while isinstance(value, dict) and '$ref' in value:
        node = DOCUMENT
        for part in value['$ref'].removeprefix('#/').split('/'):
            node = node[part.replace('~1', '/').replace('~0', '~')]
        value = node
    return value


def closed(schema):
    """The schema with all members forbidden that it does not name."""
    if isinstance(schema, list):
        return [closed(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: closed(value) for key, value in schema.items()}
    return {'additionalProperties': False, **found} if isinstance(found.get('properties'), dict) else found


CLOSED = {'schemas': closed(DOCUMENT['components']['schemas'])}
VALIDATORS = {}


def validate(where, schema, value):
    key = json.dumps(schema)
    if key not in VALIDATORS:
        VALIDATORS[key] = jsonschema.Draft202012Validator({**closed(schema), 'components': CLOSED})
    for error in VALIDATORS[key].iter_errors(value):
        raise AssertionError('%s: %s: %s' % (where, error.json_path, error.message))


def pattern_of(template):
    return re.compile(re.sub(r'\\\{\w+\\\}', '[^/]+', re.escape(template)))


SEEN = {}  # [path, status]: the headers of the answers that were held
PATHS = [(pattern_of(path), path) for path in DOCUMENT['paths']]
ANY_HEADERS = {name.lower(): header for name, header in DOCUMENT['components']['x-headers'].items()}


def path_of(target):
    """The described path that a target is one of, or None."""
    asked = target.partition('?')[0]
    return next((path for pattern, path in PATHS if pattern.fullmatch(asked)), None)


RESPONSES = DOCUMENT['components']['responses']


def any_refusal(where, status):
    assert status in RESPONSES['Refused']['x-statuses'], where + ': the status is not described'
    return RESPONSES['Refused']


def answer_of_path(where, path, status):
    """The description of an answer to GET. What a range is of, and what has not changed, has the headers of the whole,
    too."""
    answers = DOCUMENT['paths'][path]['get']['responses']
    if str(status) not in answers:
        return any_refusal(where, status)
    answer = resolve(answers[str(status)])
    if status in (206, 304):
        whole = {name: {**resolve(header), 'required': False}
                 for name, header in resolve(answers['200']).get('headers', {}).items()}
        answer = {**answer, 'headers': {**whole, **answer['headers']}}
    return answer


def answer_of(where, method, path, status, headers):
    if method == 'OPTIONS' and status == 204:
        return RESPONSES['Options']
    if method not in ('GET', 'HEAD'):
        return any_refusal(where, status)
    if status == 303 and 'set-cookie' in headers:
        return RESPONSES['Entered']
    if status == 308:
        return RESPONSES['WithSlash']
    if path:
        return answer_of_path(where, path, status)
    if status in (200, 304):  # the page and what it loads
        return DOCUMENT['components']['x-files']
    return RESPONSES['NotFound'] if status == 404 else any_refusal(where, status)


def check_headers(where, answer, headers):
    known = {name.lower(): resolve(header) for name, header in answer.get('headers', {}).items()}
    for name, header in known.items():
        assert not header.get('required') or name in headers, '%s: without %s' % (where, name)
    for name, values in headers.lists():
        assert len(values) == 1, '%s: %s is there %d times: %s' % (where, name, len(values), values)
        if name in OF_HTTP:
            continue
        header = known.get(name) or resolve(ANY_HEADERS.get(name))
        assert header, '%s: the header %s is not described' % (where, name)
        kind = header['schema'].get('type')
        assert kind != 'integer' or re.fullmatch(r'\d+', values[0]), (where, name, values)
        assert kind != 'number' or float(values[0]) is not None, (where, name, values)


def check_body(where, answer, media_type, body):
    content = answer.get('content')
    if content is None:
        assert not body, (where, body[:300])
        return
    assert media_type in content or '*/*' in content, '%s: the media type %s is not described' % (where, media_type)
    schema = content.get(media_type, {}).get('schema')
    if schema and body:
        validate(where, schema, json.loads(body))


def check_problem(where, status, headers, body):
    """A refusal says which one it is, and what to change."""
    assert headers['content-type'] == 'application/problem+json', (where, headers)
    problem = json.loads(body)
    validate(where, {'$ref': '#/components/schemas/Problem'}, problem)
    assert problem['status'] == status and problem['title'] and problem['detail'], (where, problem)


def hold(method, target, status, headers, body):
    """Fails unless this answer is described. `target` is below the base path; `body` is without its coding."""
    path = path_of(target)
    where = '%s %s: %d' % (method, target, status)
    answer = answer_of(where, method, path, status, headers)
    check_headers(where, answer, headers)
    SEEN.setdefault((path, str(status)), set()).update(headers)
    if method == 'HEAD':
        assert not body, where
        return
    check_body(where, answer, headers.get('content-type', '').partition(';')[0], body)
    if status >= 400 and headers['content-type'].startswith('application/'):
        check_problem(where, status, headers, body)
    if path and status < 300:
        check_parameters(where, path, target)


def check_parameters(where, path, target):
    """What an answer heeds is described. (The catalogue and the pages heed none.)"""
    known = {resolve(one)['name'] for one in DOCUMENT['paths'][path]['get'].get('parameters', [])}
    for name in urllib.parse.parse_qs(target.partition('?')[2], keep_blank_values=True):
        assert ('{id}' not in path or path.startswith('/view/')
                or name in known), '%s: the parameter %s is not described' % (where, name)
