"""SCPI over pyvisa: what is set on a session, and every call in its order."""

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from instrument.devices.digitizer import DigitizerError
from instrument.devices.scpi_links import Cancelled, Stalled, VisaTransport


class Session:
    """A pyvisa session that notes what is set and asked, and answers from ``answers``."""

    def __init__(self, *answers: bytes | Exception) -> None:
        self.answers, self.asked = list(answers), []
        self.timeout: object = None

    def open_resource(self, name: str) -> "Session":
        self.asked.append(("open", name))
        return self

    def __getattr__(self, call: str) -> Any:
        def answer(*given: object) -> Any:
            self.asked.append((call, *given, self.timeout))
            if call.startswith("read"):
                found = self.answers.pop(0)
                if isinstance(found, Exception):
                    raise found
                return found.decode() if call == "read" else found
            return None

        return answer


@pytest.mark.parametrize(
    ("resource", "ending"), [("TCPIP0::1.2.3.4::INSTR", None), ("TCPIP0::1.2.3.4::5025::socket", "\n")]
)
def test_a_link_over_visa_takes_pieces_of_a_mebibyte_and_ends_lines_as_its_kind_does(
    resource: str, ending: str | None
) -> None:
    session = Session(b" RIGOL \n", b"x" * 65_536, b"x" * 65_537)
    link = VisaTransport(resource, session)
    assert (session.chunk_size, session.write_termination, session.read_termination) == (1 << 20, "\n", ending)
    assert link.query("*IDN?") == "RIGOL"
    assert session.asked == [("open", resource), ("write", "*IDN?", None), ("read", 5000)]
    assert len(link.query("A?", 0.25)) == 65_536 and session.asked[-1] == ("read", 250)
    with pytest.raises(DigitizerError, match=f"oscilloscope {resource} answered A\\? without an end"):
        link.query("A?")


def test_a_block_over_visa_is_read_head_first_then_in_pieces_and_its_line_end_last() -> None:
    content = bytes(range(256)) * 4097  # a mebibyte and 256 bytes
    head = b"#7" + b"%07d" % len(content)
    letters = [bytes([letter]) for letter in head]
    link = VisaTransport("A::B", session := Session(*letters, content[: 1 << 20], content[1 << 20 :], b"\n"))
    assert link.query_block("D?", len(content), timeout_s=2.0) == content
    reads = [asked[1:] for asked in session.asked if asked[0] == "read_bytes"]
    assert reads == [(1, 2000)] * 9 + [(1 << 20, 2000), (256, 2000), (1, 2000)]

    stopped = VisaTransport("A::B", session := Session(*letters, content[: 1 << 20]))
    said = iter((False, True))
    with pytest.raises(Cancelled):
        stopped.query_block("D?", len(content), lambda: next(said))
    assert session.asked[-1] == ("clear", 10_000)  # else the rest would answer the next question

    stalled = VisaTransport("A::B", Session(*letters, content[: 1 << 20], OSError("VI_ERROR_TMO:\n timed out")))
    with pytest.raises(Stalled, match="oscilloscope A::B: VI_ERROR_TMO: timed out: check the link and re-arm") as found:
        stalled.query_block("D?", len(content))
    assert found.value.received == content[: 1 << 20]
    silent = VisaTransport("A::B", Session(*letters))
    with pytest.raises(DigitizerError, match=r"oscilloscope A::B does not answer D\? in time"):
        silent.query_block("D?", len(content), timeout_s=0.0)
    silent.close()


def test_visa_without_a_library_of_a_maker_is_the_one_in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, ...]] = []

    def manager(*kind: str) -> Session:
        asked.append(kind)
        if len(asked) in (1, 3, 4):
            raise ValueError("no library")
        return Session()

    monkeypatch.setitem(sys.modules, "pyvisa", SimpleNamespace(ResourceManager=manager))
    VisaTransport("A::B")
    assert asked == [(), ("@py",)]
    with pytest.raises(DigitizerError, match="pyvisa finds no VISA library: pip install"):
        VisaTransport("A::B")
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    with pytest.raises(DigitizerError, match="A::B needs pyvisa, which is not installed: pip install"):
        VisaTransport("A::B")
