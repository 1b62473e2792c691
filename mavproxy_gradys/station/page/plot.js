// A quantity over time: the band from the smallest to the largest value of each part, gaps, and what came late.
const LEFT = 70, RIGHT = 12, TOP = 10, BOTTOM = 22, FAR = 90; // pixels
const FIRST = 0, LAST = 1, LOW = 2, HIGH = 3;
const STEPS = [1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200, 21600, 43200, 86400, 172800]; // s

export function drawPlot(canvas, history, unit) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight,
    pen = canvas.getContext("2d");
  canvas.width = width * ratio; canvas.height = height * ratio;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  const {parts} = history;
  if (!parts.length) {
    pen.fillStyle = "#7d8794";
    pen.fillText("no numbers in this time", LEFT, height / 2);
    return;
  }
  const [low, high] = limits(parts), from = history.from, to = history.to;
  const across = at => LEFT + (at - from) / (to - from) * (width - LEFT - RIGHT);
  const up = value => height - BOTTOM - (value - low) / (high - low) * (height - TOP - BOTTOM);
  pen.fillStyle = "#5a2b33";
  for (const [start, end] of history.gaps)
    pen.fillRect(across(start), TOP, Math.max(across(end) - across(start), 1), height - TOP - BOTTOM);
  drawAxes(pen, {low, high, from, to, across, up, width, height, unit});
  drawBand(pen, parts, new Set(history.gaps.map(([start]) => start)), across, up);
  pen.fillStyle = "#e8b339";
  for (const [start, end] of history.late)
    pen.fillRect(across(start), height - BOTTOM - 5, Math.max(across(end) - across(start), 2), 5);
}

function limits(parts) {
  let low = Infinity, high = -Infinity;
  for (const part of parts) { low = Math.min(low, part[LOW]); high = Math.max(high, part[HIGH]); }
  const room = (high - low) * 0.05 || Math.abs(high) * 0.01 || 1;
  return [low - room, high + room];
}

function drawBand(pen, parts, beforeGaps, across, up) {
  pen.strokeStyle = pen.fillStyle = "#7db4ff";
  pen.lineWidth = 1.2;
  let run = [];
  const end = () => {
    if (run.length === 1) pen.fillRect(across(run[0][FIRST]) - 1, up(run[0][HIGH]) - 1, 2, 2);
    pen.beginPath();
    for (const part of run) {
      pen.lineTo(across(part[FIRST]), up(part[LOW]));
      if (part[HIGH] !== part[LOW]) pen.lineTo(across((part[FIRST] + part[LAST]) / 2), up(part[HIGH]));
    }
    pen.stroke();
    run = [];
  };
  for (const part of parts) { run.push(part); if (beforeGaps.has(part[LAST])) end(); }
  end();
}

function drawAxes(pen, {low, high, from, to, across, up, width, height, unit}) {
  pen.strokeStyle = "#2b3644";
  pen.fillStyle = "#9aa5b1";
  pen.lineWidth = 1;
  const step = niceStep((high - low) / Math.max(2, (height - TOP - BOTTOM) / 40));
  pen.textAlign = "right";
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
    line(pen, LEFT, up(value), width - RIGHT, up(value));
    pen.fillText(String(Number(value.toPrecision(8))), LEFT - 6, up(value) + 4);
  }
  pen.textAlign = "center";
  const every = STEPS.find(seconds => seconds / (to - from) * (width - LEFT - RIGHT) >= FAR)
    || STEPS[STEPS.length - 1];
  const zone = new Date(from * 1000).getTimezoneOffset() * 60;
  for (let at = Math.ceil((from - zone) / every) * every + zone; at <= to; at += every) {
    line(pen, across(at), TOP, across(at), height - BOTTOM);
    pen.fillText(clock(at, every), across(at), height - 6);
  }
  pen.textAlign = "left";
  pen.fillText(unit.slice(0, 60), LEFT + 6, TOP + 12);
}

function line(pen, x1, y1, x2, y2) { pen.beginPath(); pen.moveTo(x1, y1); pen.lineTo(x2, y2); pen.stroke(); }

function niceStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map(n => n * power).find(n => n >= raw);
}

function clock(at, every) {
  const date = new Date(at * 1000), two = n => String(n).padStart(2, "0");
  if (every >= 86400) return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())}`;
  const minute = `${two(date.getHours())}:${two(date.getMinutes())}`;
  return every >= 60 ? minute : `${minute}:${two(date.getSeconds())}`;
}
