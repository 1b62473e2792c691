"""The page's calls of the API: what waits for what, and what a stop does to them; in a real browser."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.support.chromium import chromium
from tests.support.page_checks import failures

pytestmark = pytest.mark.needs("chromium")

# Calls of the API that are not answered until their signal ends them; `sent` has their paths, `open` answers one.
HELD_CALLS = """
  const sent = [], open = {};
  const settle = async () => { for (let n = 0; n < 20; n += 1) await new Promise(resolve => setTimeout(resolve)); };
  window.fetch = (address, {signal}) => new Promise((resolve, reject) => {
    const path = address.slice(1); // the page's own folder is the root
    sent.push(path);
    open[path] = () => resolve(new Response('{}'));
    signal.addEventListener('abort', () => reject(signal.reason));
  });
  const said = {}, ask = (name, call) => call.then(() => { said[name] = 'done'; }, e => { said[name] = e.message; });
  const a = new m.Api();
"""
READS = HELD_CALLS + "ask('log', a.blob('/log', 600000)); ask('list', a.get('/list'));"
COMMANDS = HELD_CALLS + "ask('log', a.call('POST', '/log')); ask('list', a.call('POST', '/list'));"

CHECKS = {
    # both slots are held by slow calls
    "api": [
        # a stop goes out at once, and no command that waits goes out after it
        f"""(async () => {{{READS}
           ask('go', a.command('/go_to')); ask('start', a.call('POST', '/start')); ask('read', a.get('/read'));
           ask('hold', a.urgent('/fleet/brake'));
           const first = same(sent, ['/log', '/list', '/fleet/brake']);
           open['/fleet/brake'](); open['/list']();
           await settle();
           const why = 'not sent: a stop came first';
           return first && same(sent.slice(3), ['/read']) && said.go === why && said.start === why
             && said.hold === 'done';
           }})()""",
        # a command that has waited too long is not sent, even if no timer told so meanwhile
        f"""(async () => {{{COMMANDS}
           const clock = performance.now.bind(performance);
           ask('go', a.command('/go_to'));
           performance.now = () => clock() + 1500;
           try {{ open['/list'](); await settle(); }} finally {{ delete performance.now; }}
           return same(sent, ['/log', '/list']) && said.go === 'not sent: the page was busy'; }})()""",
        # a command goes before the reads that wait
        f"""(async () => {{{COMMANDS}
           ask('read', a.get('/read')); ask('go', a.command('/go_to'));
           open['/list']();
           await settle();
           return same(sent, ['/log', '/list', '/go_to?wait=false']); }})()""",
        # of two slow reads the older one gives up its slot for a command; the next command takes the other's
        f"""(async () => {{{READS}
           ask('go', a.command('/go_to')); await settle();
           const kept = said.list === undefined && said.log === 'given up for a command';
           ask('set', a.call('PUT', '/set')); await settle();
           return kept && said.list === said.log && same(sent.slice(2), ['/go_to?wait=false', '/set']); }})()""",
        # one connection is for stops: a second stop without an answer takes those of the slots, and nothing else does
        f"""(async () => {{{READS}
           ask('one', a.stop('/one')); await settle();
           const kept = said.log === undefined;
           ask('hold', a.urgent('/fleet/brake')); ask('read', a.get('/read')); ask('more', a.get('/more'));
           await settle();
           return kept && said.log === said.list && said.log.startsWith('given up')
             && same(sent.slice(2), ['/one?wait=false', '/fleet/brake', '/read']); }})()""",
        # a command that is under way without an answer is given up: the browser may not have sent it yet
        """(async () => {
           const signals = {}, said = [];
           window.fetch = (address, {signal}) => new Promise((_, no) => { signals[address] = signal;
             signal.addEventListener('abort', () => no(signal.reason)); });
           const a = new m.Api();
           a.command('/go_to').catch(e => said.push(e.message)); a.urgent('/fleet/brake');
           await new Promise(resolve => setTimeout(resolve));
           return said[0].startsWith('given up') && !signals['./fleet/brake'].aborted; })()""",
        # a 401 to a call with a token from before asks for none
        """(async () => {
           const answers = [], a = new m.Api();
           let asked = 0;
           a.addEventListener('token', () => { asked += 1; });
           const refuse = () => new Response('{}', {status: 401});
           window.fetch = () => new Promise(resolve => answers.push(() => resolve(refuse())));
           const old = [a.get('/a'), a.open('/b')].map(call => call.catch(() => {}));
           a.setToken('new');
           for (const answer of answers.splice(0)) answer();
           await Promise.all(old);
           const early = asked, late = a.get('/c').catch(() => {});
           answers[0]();
           await late;
           a.setToken('');
           return same([early, asked], [0, 1]); })()""",
    ],
}


def test_calls_wait_for_their_turn_and_for_no_stop(address: str, tmp_path: Path) -> None:
    async def look() -> list[str]:
        async with chromium(tmp_path) as page:
            return await failures(page, address, CHECKS)

    assert asyncio.run(look()) == []
