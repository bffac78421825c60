"""Frames: complete messages and rejected ones."""

from __future__ import annotations

import json
import unittest

import numpy as np

from actcheck import Closed, ProtocolFault
from actcheck.wire import MOST_RECEIVED, Wire
from tests.fake import Simulation


class Frames(unittest.TestCase):
    def test_messages_and_arrays_come_as_they_were_sent(self) -> None:
        depth = np.linspace(0.5, 3.0, 12, dtype="<f4").reshape(3, 4)

        def script(simulation: Simulation) -> None:
            announced = [{"name": "depth", "dtype": "f32", "shape": [3, 4]}]
            simulation.send({"type": "answer", "words": "Gläser", "binary": announced}, depth)
            simulation.send({"type": "bye"})
            simulation.receive("ask")

        simulation = Simulation(script)
        answer = simulation.wire.receive()
        self.assertEqual(answer["words"], "Gläser")
        np.testing.assert_array_equal(answer["arrays"]["depth"], depth)
        self.assertEqual(simulation.wire.receive(), {"type": "bye"})
        simulation.wire.send({"type": "ask", "what": "Tiefe ü"})
        simulation.join()
        self.assertEqual(simulation.received, [{"type": "ask", "what": "Tiefe ü"}])

    def test_pieces_of_frames_are_put_together(self) -> None:
        payload = json.dumps({"type": "bye", "filler": "x" * 200_000}).encode()

        def script(simulation: Simulation) -> None:
            frame = len(payload).to_bytes(4, "little") + b"J" + payload
            for start in range(0, len(frame), 7_001):
                simulation._socket.sendall(frame[start : start + 7_001])
            simulation.bye()

        simulation = Simulation(script)
        self.assertEqual(len(simulation.wire.receive()["filler"]), 200_000)
        self.assertEqual(simulation.wire.receive()["type"], "bye")
        simulation.join()

    def test_what_is_no_message_is_refused(self) -> None:
        faults = {
            "invalid JSON": (b"J", b"{nonsense"),
            "not an object": (b"J", b"[1, 2]"),
            "`type`": (b"J", b'{"kind": "bye"}'),
            "binary frame": (b"B", b"1234"),
        }
        for words, (kind, payload) in faults.items():
            simulation = Simulation(lambda simulation, frame=(kind, payload): simulation.send_bytes(*frame))  # type: ignore[misc]
            with self.assertRaisesRegex(ProtocolFault, words):
                simulation.wire.receive()
            simulation.join()

    def test_an_array_of_another_length_than_announced_is_refused(self) -> None:
        def script(simulation: Simulation) -> None:
            announced = [{"name": "depth", "dtype": "f32", "shape": [3, 4]}]
            simulation.send({"type": "answer", "binary": announced}, np.zeros(11, dtype="<f4"))

        simulation = Simulation(script)
        with self.assertRaisesRegex(ProtocolFault, "44 bytes"):
            simulation.wire.receive()

    def test_a_frame_over_the_limit_is_refused_before_it_is_read(self) -> None:
        header = (MOST_RECEIVED + 1).to_bytes(4, "little") + b"J"
        simulation = Simulation(lambda simulation: simulation._socket.sendall(header))
        with self.assertRaisesRegex(ProtocolFault, "too long"):
            simulation.wire.receive()

    def test_a_long_message_and_what_is_no_number_are_not_sent(self) -> None:
        simulation = Simulation(lambda simulation: None)
        with self.assertRaisesRegex(ValueError, "too long"):
            simulation.wire.send({"type": "end", "message": "x" * (1 << 20)})
        with self.assertRaises(ValueError):
            simulation.wire.send({"type": "command", "positions": {"arm": float("nan")}})

    def test_an_end_that_hangs_up_is_told(self) -> None:
        simulation = Simulation(lambda simulation: None)
        with self.assertRaisesRegex(Closed, "closed the connection|lost"):
            simulation.wire.receive()

    def test_addresses(self) -> None:
        with self.assertRaisesRegex(ProtocolFault, "unix:/path"):
            Wire.dial("tcp:somewhere")
        with self.assertRaisesRegex(Closed, "can't connect"):
            Wire.dial("unix:/nowhere/at/all.sock")
        with self.assertRaisesRegex(ProtocolFault, "test_launcher"):
            Wire.from_environment()


if __name__ == "__main__":
    unittest.main()
