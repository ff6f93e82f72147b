"""The link that opens the page with a token: made when the tokens are, and not shown again."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO
from urllib.parse import quote

from motionserver.web.tokens import load_tokens


def ensure_tokens(path: Path) -> bool:
    """Make the tokens file if there is none, and check it.

    Returns:
        True if it was made just now.

    Raises:
        WebConfigError: It cannot be made or read, or the page would refuse it.
    """
    is_new = not path.exists()
    load_tokens(path)
    return is_new


def operator_token(path: Path) -> str:
    """The operator's token of a file that `ensure_tokens` made."""
    return str(json.loads(path.read_text("utf-8"))["operator"])


def page_url(web: Mapping[str, Any]) -> str:
    """Address of the page, without a token.

    Args:
        web: The page's part of what `settings.resolve` made.
    """
    scheme = "https" if web["tls_cert"] else "http"
    host = f"[{web['host']}]" if ":" in web["host"] else web["host"]
    return f"{scheme}://{host}:{web['port']}"


def page_link(url: str, token: str) -> str:
    """A link whose fragment, which browsers send to nobody, hands the token to the page."""
    return f"{url}/#token={quote(token, safe='')}"


def first_start_text(web: Mapping[str, Any], output: TextIO) -> str:
    """What `run` says of the page and its tokens.

    Args:
        web: The page's part of what `settings.resolve` made.
        output: Where it will be written; a token does not go into the system's journal.

    Returns:
        The link with the operator's token if the tokens were made just now, else where they are.
    """
    path, url = Path(web["tokens_file"]), page_url(web)
    is_new = ensure_tokens(path)
    if is_new and not _is_journal(output):
        link = page_link(url, operator_token(path))
        return (
            f"page {link}\n"
            "This link gives operator rights and is shown at the first start only; the tokens of "
            f"viewer, tuner and operator are in {path}"
        )
    return f"page {url}, tokens in {path}"


def _is_journal(output: TextIO) -> bool:
    """Whether systemd collects what is written here."""
    try:
        about = os.fstat(output.fileno())
    except (OSError, ValueError):
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{about.st_dev}:{about.st_ino}"
