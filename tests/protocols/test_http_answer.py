"""Requests that are sent again and again, against the web server of Python."""

from __future__ import annotations

import asyncio
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx

from seerob.protocols.links.http_answer import Question


def test_a_cookie_that_was_taken_back_is_not_sent_again():
    given = iter(("session=1", "session=; Max-Age=0", "", ""))
    heard = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            heard.append(self.headers.get("Cookie"))
            self.send_response(200)
            if cookie := next(given):
                self.send_header("Set-Cookie", cookie)
            self.send_header("Content-Length", "2")
            self.end_headers()
            self.wfile.write(b"{}")

        def log_message(self, *what):
            pass

    async def asked(url):
        async with httpx.AsyncClient(trust_env=False) as client:
            question = Question(client, "GET", url, who="the server", headers={})
            return [await question.answer() for _ in range(4)]

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            answers = asyncio.run(asked(f"http://127.0.0.1:{server.server_port}/"))
        finally:
            server.shutdown()
            thread.join()
    assert answers == [b"{}"] * 4
    assert heard == [None, "session=1", None, None]
