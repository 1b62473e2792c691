from __future__ import annotations

import pytest

from mavproxy_uavapi.http.callers.browser import browsers_header
from tests.support.drone import Drone
from tests.uavapi.http.conftest import Api

JAVA = "text/html, image/gif, image/jpeg, *; q=.2, */*; q=.2"
POWERSHELL_5 = "Mozilla/5.0 (Windows NT; Windows NT 10.0; en-US) WindowsPowerShell/5.1.19041.4648"
POWERSHELL_7 = "Mozilla/5.0 (Windows NT 10.0; Microsoft Windows 10.0.19045; en-US) PowerShell/7.4.2"
FORM, JSON = "application/x-www-form-urlencoded", "application/json"
# The headers that each sends by default; `Content-Type` is that of a POST.
CALLERS: dict[str, dict[str, str]] = {
    "Java 8, HttpURLConnection": {
        "Cache-Control": "no-cache", "Pragma": "no-cache", "User-Agent": "Java/1.8.0_402", "Accept": JAVA,
        "Connection": "keep-alive", "Content-Type": FORM,
    },
    "Java 21, HttpURLConnection": {
        "User-Agent": "Java/21.0.2", "Accept": "text/html, image/gif, image/jpeg, */*; q=0.2",
        "Connection": "keep-alive", "Content-Type": FORM,
    },
    "Java 11, HttpClient": {
        "Connection": "Upgrade, HTTP2-Settings", "HTTP2-Settings": "AAEAAEAAAAIAAAABAAMAAABkAAQBAAAAAAUAAEAA",
        "Upgrade": "h2c", "User-Agent": "Java-http-client/11.0.22", "Content-Type": JSON,
    },
    "Android, HttpURLConnection": {
        "User-Agent": "Dalvik/2.1.0 (Linux; U; Android 14; Pixel 7 Build/AP1A.240505.004)",
        "Connection": "Keep-Alive", "Accept-Encoding": "gzip", "Content-Type": FORM,
    },
    "Qt 5 and 6, QNetworkAccessManager": {
        "Connection": "Keep-Alive", "Accept-Encoding": "gzip, deflate", "Accept-Language": "en-US,*",
        "User-Agent": "Mozilla/5.0", "Content-Type": FORM,
    },
    "QGIS": {
        "User-Agent": "Mozilla/5.0 QGIS/33400/Linux", "Accept-Encoding": "gzip, deflate",
        "Accept-Language": "en-US,*", "Connection": "Keep-Alive", "Content-Type": JSON,
    },
    "MATLAB, webread and webwrite": {
        "User-Agent": "MATLAB 9.13.0.2049777 (R2022b)", "Accept": "*/*", "Accept-Encoding": "deflate, gzip",
        "Connection": "close", "Content-Type": JSON,
    },
    "MATLAB R2014b, by Java": {
        "User-Agent": "MATLAB 8.4.0.150421 (R2014b)", "Accept": JAVA, "Connection": "close", "Content-Type": FORM,
    },
    ".NET, HttpClient": {"Content-Type": "application/json; charset=utf-8"},
    ".NET Framework, WebClient": {"Connection": "Keep-Alive", "Expect": "100-continue", "Content-Type": FORM},
    "VBA, WinHttp": {
        "Connection": "Keep-Alive", "Accept": "*/*", "Content-Type": JSON,
        "User-Agent": "Mozilla/4.0 (compatible; Win32; WinHttp.WinHttpRequest.5)",
    },
    "PowerShell 5, Invoke-RestMethod": {
        "User-Agent": POWERSHELL_5, "Connection": "Keep-Alive", "Expect": "100-continue", "Content-Type": FORM,
    },
    "PowerShell 7, Invoke-RestMethod": {"User-Agent": POWERSHELL_7, "Content-Type": JSON},
    "Node-RED, http request": {
        "user-agent": "got (https://github.com/sindresorhus/got)", "accept-encoding": "gzip, deflate, br",
        "Connection": "close", "Content-Type": JSON,
    },
    "Node.js, fetch": {
        "accept": "*/*", "accept-language": "*", "sec-fetch-mode": "cors", "user-agent": "node",
        "accept-encoding": "gzip, deflate", "connection": "keep-alive", "Content-Type": JSON,
    },
    "axios": {
        "Accept": "application/json, text/plain, */*", "User-Agent": "axios/1.7.2",
        "Accept-Encoding": "gzip, compress, deflate, br", "Connection": "keep-alive", "Content-Type": JSON,
    },
    "ESP32, HTTPClient": {
        "User-Agent": "ESP32HTTPClient", "Connection": "keep-alive",
        "Accept-Encoding": "identity;q=1,chunked;q=0.1,*;q=0", "Content-Type": JSON,
    },
    "ESP-IDF, esp_http_client": {"User-Agent": "ESP32 HTTP Client/1.0", "Content-Type": FORM},
    "ESPHome": {"User-Agent": "ESPHome/2024.6 (https://esphome.io)", "Connection": "close", "Content-Type": JSON},
    "Unity": {
        "User-Agent": "UnityPlayer/2022.3.20f1 (UnityWebRequest/1.0, libcurl/8.5.0-DEV)", "Accept": "*/*",
        "Accept-Encoding": "deflate, gzip", "X-Unity-Version": "2022.3.20f1", "Content-Type": JSON,
    },
    "Go": {"User-Agent": "Go-http-client/1.1", "Accept-Encoding": "gzip", "Content-Type": JSON},
    "wget": {
        "User-Agent": "Wget/1.21.4", "Accept": "*/*", "Accept-Encoding": "identity", "Connection": "Keep-Alive",
        "Content-Type": FORM,
    },
}  # fmt: skip
CHROMIUM = "Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/140.0.0.0 Safari/537.36"
FIREFOX = "Mozilla/5.0 (Android 14; Mobile; rv:127.0) Gecko/127.0 Firefox/127.0"
PAGE = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"
AUTOMATIC = ["User-Agent", "Accept", "Accept-Encoding", "Content-Type"]
LAN = {"Host": "192.168.1.5:8000"}


@pytest.mark.matrix
@pytest.mark.parametrize("headers", CALLERS.values(), ids=CALLERS)
def test_program_flies_with_the_headers_that_it_sends_by_default(
    flying: Drone, api: Api, headers: dict[str, str]
) -> None:
    reading = {name: value for name, value in headers.items() if name not in ("Content-Type", "Expect")}
    answer = api.get("/command/set_ground_speed?new_v=5", headers={**LAN, **reading}, skip_auto_headers=AUTOMATIC)
    assert answer.body["result"] == "Ground speed set to 5m/s"
    body = "x=1&y=2&z=-30" if headers["Content-Type"] == FORM else '{"x": 1, "y": 2, "z": -30}'
    answer = api.post("/movement/go_to_ned", data=body, headers={**LAN, **headers}, skip_auto_headers=AUTOMATIC)
    assert answer.body["result"] == "Going to NED coord (1, 2, -30)"


@pytest.mark.parametrize(
    "headers",
    [{"User-Agent": CHROMIUM}, {"User-Agent": FIREFOX, "Accept": "*/*"}, {"Accept": PAGE}, {"Accept": "image/png"}],
    ids=["Chromium", "Firefox", "a nameless page", "a nameless picture"],
)
def test_browser_that_names_no_page_hears_which_header_made_it_one(
    flying: Drone, api: Api, headers: dict[str, str]
) -> None:
    answer = api.get("/command/arm", headers={**LAN, **headers}, skip_auto_headers=AUTOMATIC)
    name, value = next(iter(headers.items()))
    assert answer.status == 403
    assert f"{name}: {value}"[:120] in answer.body["detail"]
    assert "is a browser's header" in answer.body["detail"]
    assert flying.received == []


def test_header_of_a_browser_is_named() -> None:
    assert browsers_header({"User-Agent": CHROMIUM}) == f"User-Agent: {CHROMIUM}"
    assert browsers_header({"User-Agent": "x", "Accept": PAGE}) == f"Accept: {PAGE}"
    assert browsers_header({}) == browsers_header({"User-Agent": "Mozilla/5.0", "Accept": JAVA}) == ""
