// Draws rows of bars against time; dragging and keys change the span.

import {useEffect, useRef, useState} from "preact/hooks";

import {fleetNow, ticks} from "../fleet_clock.js";
import {html} from "../html.js";
import {pathTo} from "../routes.js";
import {clockTime, momentText} from "../words.js";

const ROW_PX = 24;
const HEAD_PX = 22;
const NAMES_PX = 190;
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

function zoomed({from, to}, factor, about) {
  const length = Math.min(MOST_SPAN_MS, Math.max(LEAST_SPAN_MS, (to - from) * factor));
  const share = (about - from) / (to - from);
  return {from: about - share * length, to: about + (1 - share) * length};
}

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
    const {moved} = settle.current;
    settle.current = null;
    begin.current = clientX;
    onSpan({from: span.from + moved, to: span.to + moved});
  };
  return {
    shown: {from: span.from + shift, to: span.to + shift},
    handlers: {
      onPointerDown: ({clientX}) => (begin.current = clientX),
      onPointerMove: ({clientX, buttons}) => {
        if (begin.current === null || buttons === 0) return;
        const moved = ((begin.current - clientX) * (span.to - span.from)) / chartWidth;
        setDrag({span, shift: moved});
        clearTimeout(settle.current?.timer);
        settle.current = {moved, timer: setTimeout(() => settled(clientX), DRAG_SETTLES_MS)};
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
  const width = useWidth(element);
  const chartWidth = Math.max(100, width - NAMES_PX);
  const {shown, handlers} = useDrag(span, onSpan, chartWidth);
  const xOf = (ms) => NAMES_PX + ((ms - shown.from) / (shown.to - shown.from)) * chartWidth;
  const height = HEAD_PX + rows.length * ROW_PX + 6;
  const middle = (span.from + span.to) / 2;
  const onKeyDown = ({key}) => {
    const step = (span.to - span.from) / 4;
    if (key === "+") onSpan(zoomed(span, 0.5, middle));
    if (key === "-") onSpan(zoomed(span, 2, middle));
    if (key === "ArrowLeft") onSpan({from: span.from - step, to: span.to - step});
    if (key === "ArrowRight") onSpan({from: span.from + step, to: span.to + step});
  };
  return html`
    <div class="gantt" ref=${element} tabindex="0" role="group" aria-label="Calendar"
      onKeyDown=${onKeyDown}>
      <svg viewBox="0 0 ${width} ${height}" height=${height} ...${handlers}>
        <${Grid} shown=${shown} xOf=${xOf} height=${height} chartWidth=${chartWidth} />
        ${rows.map((row, number) => html`
          <${Row} key=${row.id} row=${row} y=${HEAD_PX + number * ROW_PX} xOf=${xOf} width=${width} />`)}
        <line class="now" x1=${xOf(fleetNow())} x2=${xOf(fleetNow())} y1="0" y2=${height} />
      </svg>
    </div>`;
}

const Grid = ({shown, xOf, height, chartWidth}) => gridMoments(shown, chartWidth).map((moment) => html`
  <g key=${moment}>
    <line class="grid" x1=${xOf(moment)} x2=${xOf(moment)} y1="0" y2=${height} />
    <text x=${xOf(moment) + 3} y="14">${clockTime(moment)}</text>
  </g>`);

function Row({row, y, xOf, width}) {
  return html`
    <g class="row">
      ${row.bars.map(({start, end, kind, text, href}, number) => {
        const [left, right] = [Math.max(NAMES_PX, xOf(start)), Math.min(width, xOf(end))];
        if (right <= left) return null;
        const bar = html`
          <rect key=${number} class=${kind} x=${left} y=${y + 3} width=${Math.max(1.5, right - left)}
            height=${ROW_PX - 6} rx="3">
            <title>${text}: ${momentText(start)} to ${momentText(end)}</title>
          </rect>`;
        return href ? html`<a href=${pathTo(...href)}>${bar}</a>` : bar;
      })}
      <a href=${pathTo(...row.href)}><text x="6" y=${y + 16}>${row.name}</text></a>
    </g>`;
}
