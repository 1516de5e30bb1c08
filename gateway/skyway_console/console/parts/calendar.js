// Draws rows of bars against time; dragging, keys and buttons change the span. What the pointer or the
// keyboard is on says more about itself.

import {useEffect, useRef, useState} from "preact/hooks";

import {fleetNow, ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {clockTime, momentText} from "../words.js";
import {CalendarRow, ROW_PX} from "./calendar_row.js";

const HEAD_PX = 26;
const NAMES_PX = 170;
const TIP_PX = {width: 270, height: 132};
const LEAST_SPAN_MS = 600_000;
const MOST_SPAN_MS = 7 * 86_400_000;
const MINUTE_MS = 60_000;
const GRIDS_MS = [5, 15, 30, 60, 180, 360, 720, 1_440].map((minutes) => minutes * MINUTE_MS);
const DRAG_SETTLES_MS = 250;

// Moments of grid lines: about one per 110 pixels.
function gridMoments({from, to}, width) {
  const wanted = ((to - from) * 110) / Math.max(width, 1);
  const step = GRIDS_MS.find((each) => each >= wanted) ?? GRIDS_MS.at(-1);
  const first = Math.ceil(from / step) * step;
  return Array.from({length: Math.max(0, Math.ceil((to - first) / step))}, (_, n) => first + n * step);
}

// A span that is shorter or longer, around its middle.
export function zoomed({from, to}, factor) {
  const about = (from + to) / 2;
  const length = Math.min(MOST_SPAN_MS, Math.max(LEAST_SPAN_MS, (to - from) * factor));
  return {from: about - length / 2, to: about + length / 2};
}

// A span that lies earlier or later by a part of its length.
export const moved = ({from, to}, share) => ({from: from + share * (to - from), to: to + share * (to - from)});

function useWidth(element) {
  const [width, setWidth] = useState(900);
  useEffect(() => {
    const watcher = new ResizeObserver(([{contentRect}]) => setWidth(contentRect.width));
    watcher.observe(element.current);
    return () => watcher.disconnect();
  }, []);
  return width;
}

// While somebody drags, only the picture moves. When the pointer rests or is let go, the new span is
// asked for; the drag goes on from there.
function useDrag(span, onSpan, chartWidth) {
  const [drag, setDrag] = useState({span, shift: 0});
  const begin = useRef(null);
  const settle = useRef(null);
  useEffect(() => () => clearTimeout(settle.current?.timer), []);
  // A shift counts from the span in which it was made.
  const shift = drag.span === span ? drag.shift : 0;
  const settled = (clientX) => {
    if (settle.current === null) return;
    clearTimeout(settle.current.timer);
    const {shift: settledShift} = settle.current;
    settle.current = null;
    begin.current = clientX;
    onSpan({from: span.from + settledShift, to: span.to + settledShift});
  };
  return {
    shown: {from: span.from + shift, to: span.to + shift},
    handlers: {
      onPointerDown: ({clientX}) => (begin.current = clientX),
      onPointerMove: ({clientX, buttons}) => {
        if (begin.current === null || buttons === 0) return;
        const dragged = ((begin.current - clientX) * (span.to - span.from)) / chartWidth;
        setDrag({span, shift: dragged});
        clearTimeout(settle.current?.timer);
        settle.current = {shift: dragged, timer: setTimeout(() => settled(clientX), DRAG_SETTLES_MS)};
      },
      onPointerUp: ({clientX}) => {
        settled(clientX);
        begin.current = null;
      },
    },
  };
}

export function Calendar({rows, span, onSpan}) {
  ticks.value; // read so that the line of the present moves
  const element = useRef(null);
  const [tip, setTip] = useState(null);
  const width = useWidth(element);
  const chartWidth = Math.max(100, width - NAMES_PX);
  const {shown, handlers} = useDrag(span, onSpan, chartWidth);
  const xOf = (ms) => NAMES_PX + ((ms - shown.from) / (shown.to - shown.from)) * chartWidth;
  const area = {left: NAMES_PX, right: width, xOf};
  const height = HEAD_PX + Math.max(rows.length * ROW_PX, TIP_PX.height) + 6;
  const now = xOf(fleetNow());
  const onKeyDown = ({key}) => {
    if (key === "+") onSpan(zoomed(span, 0.5));
    if (key === "-") onSpan(zoomed(span, 2));
    if (key === "ArrowLeft") onSpan(moved(span, -0.25));
    if (key === "ArrowRight") onSpan(moved(span, 0.25));
    if (key === "Escape") setTip(null);
  };
  return html`
    <div class="gantt" ref=${element} tabindex="0" role="group" aria-label="Calendar"
      onKeyDown=${onKeyDown}>
      <svg viewBox="0 0 ${width} ${height}" height=${height} ...${handlers}>
        <${Grid} shown=${shown} xOf=${xOf} height=${height} chartWidth=${chartWidth} />
        ${rows.map((row, number) => html`
          <${CalendarRow} key=${row.id} row=${row} y=${HEAD_PX + number * ROW_PX} area=${area} onShow=${setTip} />`)}
        <line class="now" x1=${now} x2=${now} y1="0" y2=${height} />
        ${now > NAMES_PX && html`<text class="now-text" x=${now + 4} y=${height - 6}>now</text>`}
        ${tip && html`<${Tip} ...${tip} width=${width} height=${height} />`}
      </svg>
    </div>`;
}

const Grid = ({shown, xOf, height, chartWidth}) => gridMoments(shown, chartWidth).map((moment) => html`
  <g key=${moment}>
    <line class="grid" x1=${xOf(moment)} x2=${xOf(moment)} y1="0" y2=${height} />
    <text class="soft" x=${xOf(moment) + 4} y="17">${clockTime(moment)}</text>
  </g>`);

// Below its bar, or above where there is no room.
function Tip({bar, x, y, width, height}) {
  const {name, way, state, start, end, promises} = bar;
  const below = y + 32;
  const top = below + TIP_PX.height > height ? Math.max(0, y - TIP_PX.height - 2) : below;
  return html`
    <foreignObject class="tip-place" x=${Math.max(0, Math.min(x, width - TIP_PX.width - 4))} y=${top} ...${TIP_PX}>
      <div class="tip" role="tooltip">
        <strong>${name}</strong>
        <p>${way}</p>
        <p>${momentText(start)} to ${momentText(end)}. ${state}.</p>
        ${promises.map(({packageId, at, isMissed}) => html`
          <p class=${isMissed ? "late" : ""}>${packageId} promised by ${momentText(at)}${isMissed ? ", comes too late" : ""}</p>`)}
        ${bar.href && html`<small>Enter or click opens it.</small>`}
      </div>
    </foreignObject>`;
}
