"""A pilot's page without a browser."""

import asyncio
import http.client
import json
from functools import partial

import tornado.httpclient
import tornado.websocket


class Page:
    """What a page's script does, without a browser."""

    def __init__(self, server, name="one", port=None, **headers):
        self.heard, self.closed, self._reading = [], False, None
        self._loop = asyncio.new_event_loop()
        url = f"ws://127.0.0.1:{port or server.port}/ws?page={name}&token={server.token}"
        headers = {"Host": f"127.0.0.1:{server.port}"} | headers if port else headers
        request = tornado.httpclient.HTTPRequest(url, headers=headers, request_timeout=100)
        self._socket = self._do(partial(tornado.websocket.websocket_connect, request))

    def _do(self, call):
        async def wait():
            return await asyncio.wait_for(asyncio.ensure_future(call()), 100)

        return self._loop.run_until_complete(wait())

    def say(self, /, **words):
        self._do(partial(self._socket.write_message, json.dumps(words)))

    def say_raw(self, text):
        self._do(partial(self._socket.write_message, text))

    def hear(self):
        message = self._do(self._socket.read_message)
        if message is None:
            self.closed = True
            raise ConnectionError("closed")
        return json.loads(message) if isinstance(message, str) else message

    def hear_within(self, seconds):
        """The next message, None if none comes in time."""
        if self._reading is None:
            self._reading = self._do(self._begin_reading)
        if not self._loop.run_until_complete(self._wait(seconds)):
            return None
        message, self._reading = self._reading.result(), None
        if message is None:
            raise ConnectionError("closed")
        return json.loads(message) if isinstance(message, str) else message

    async def _begin_reading(self):
        return asyncio.ensure_future(self._socket.read_message())

    async def _wait(self, seconds):
        """Whether there is a message in time."""
        done, _ = await asyncio.wait([self._reading], timeout=seconds)
        return bool(done)

    def hear_until(self, good):
        """The first message that is good; frames and states before it are acknowledged."""
        while True:
            message = self.hear()
            if good(message):
                return message
            if isinstance(message, bytes) or message["kind"] == "state":
                self.say(shown="frame" if isinstance(message, bytes) else "state")

    def role(self):
        return self.hear_until(lambda m: isinstance(m, dict) and m["kind"] == "role")["role"]

    def leave(self):
        self._socket.close()
        self._loop.run_until_complete(asyncio.sleep(0.05))


def answer(server, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=100)
    given = {"Host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=given)
    return connection.getresponse()


UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec_WebSocket_Version": "13",
    "Sec_WebSocket_Key": "x" * 22 + "==",
}
