// A drone's charge over time: what it measured, and what its plan says.

import uPlot from "uplot";
import {useEffect, useRef} from "preact/hooks";

import {get, part} from "../api.js";
import {fleetNow} from "../fleet_clock.js";
import {html} from "../html.js";
import {colours} from "../map/colours.js";
import {useRead} from "../use_read.js";
import {clockTime, marginText, zoneName} from "../words.js";
import {plannedCharge} from "./planned_charge.js";

const BEFORE_S = 3_600;
const AGAIN_MS = 5_000;
const SIZE = {width: 300, height: 150};

const seconds = (moment) => Date.parse(moment) / 1_000;

function planned(mission) {
  const points = plannedCharge(mission);
  return [points.map(([at]) => at), points.map(([, soc]) => soc)];
}

async function readCharges(providerId, droneId, missionId) {
  const now = fleetNow();
  const path = `/v1/providers/${part(providerId)}/drones/${part(droneId)}/telemetry`;
  const span = `from=${new Date(now - BEFORE_S * 1_000).toISOString()}&resolution=minute&limit=500`;
  const [{items}, progress] = await Promise.all([
    get(`${path}?${span}`),
    missionId ? get(`/v1/missions/${part(missionId)}`) : null,
  ]);
  const measured = [items.map(({at}) => seconds(at)), items.map(({soc}) => soc)];
  const plan = progress ? planned(progress.mission) : [[], []];
  return {charges: uPlot.join([measured, plan]), margins: progress?.mission.margins};
}

function chartOptions() {
  const paint = colours();
  const axis = {stroke: paint.text, grid: {stroke: paint.edge, width: 1}, ticks: {show: false}};
  return {
    ...SIZE,
    cursor: {show: false},
    legend: {show: false},
    scales: {y: {range: [0, 1]}},
    axes: [{...axis, space: 56, values: (_, all) => all.map((at) => clockTime(at * 1_000))}, {...axis, size: 40, values: (_, all) => all.map((y) => `${Math.round(y * 100)} %`)}],
    series: [
      {},
      {label: "Measured", stroke: paint.drone, width: 2, spanGaps: true},
      {label: "Plan", stroke: paint.busy, width: 2, dash: [5, 4], spanGaps: true},
    ],
  };
}

export function ChargeChart({droneId, providerId, missionId}) {
  const element = useRef(null);
  const chart = useRef(null);
  const {answer, problem} = useRead(() => readCharges(providerId, droneId, missionId),
    {changed: `${droneId} ${missionId}`, everyMs: AGAIN_MS});
  useEffect(() => {
    if (answer === null) return;
    chart.current ??= new uPlot(chartOptions(), answer.charges, element.current);
    chart.current.setData(answer.charges);
  }, [answer]);
  useEffect(() => () => chart.current?.destroy(), []);
  const margin = marginText(answer?.margins);
  return html`
    <figure class="chart" aria-label="Charge over time">
      <div ref=${element}></div>
      <figcaption>Charge: <span class="measured">measured</span>, <span class="plan">plan</span>. Times are ${
        zoneName()}. Plan times are when a step ends.</figcaption>
      ${margin && html`<p class="hint">The plan has ${margin}.</p>`}
      ${problem && html`<p class="refused">${problem}</p>`}
    </figure>`;
}
