// How the services are: processor, memory, rates, queues, lags, last errors and counted failures.

import {useRef} from "preact/hooks";

import {get} from "../api.js";
import {html} from "../html.js";
import {useRead} from "../use_read.js";
import {dayText, durationText, inWords} from "../words.js";
import {Facts} from "../parts/facts.js";
import {failures, queues, rateBetween, sumOf} from "../parts/figures.js";
import {Promises} from "../parts/promises.js";
import {Table} from "../parts/table.js";

const EVERY_MS = 2_000;

const megabytes = (bytes) => bytes === null ? null : `${Math.round(bytes / 1e6)} MB`;
const perSecond = (rate) => rate === null ? null : `${rate.toFixed(rate < 10 ? 1 : 0)} / s`;
const seconds = (value) => value === null ? null : `${value.toFixed(1)} s`;

function partsText(figures) {
  const missing = figures
    .filter(({name, value}) => name === "skyway_part_ready" && value === 0)
    .map(({labels}) => labels.part);
  return missing.length ? `not ready: ${missing.join(", ")}` : "all ready";
}

function Service({service, before, elapsedS}) {
  const {figures} = service;
  if (!service.is_answering) {
    return html`
      <article class="card"><h2>${inWords(service.service)}</h2>
        <p class="refused">It does not answer. Look at its process and its log.</p></article>`;
  }
  const rate = (name) => rateBetween(before?.figures, figures, name, elapsedS);
  const cpu = rate("process_cpu_seconds_total");
  const started = sumOf(figures, "process_start_time_seconds");
  return html`
    <article class="card">
      <h2>${inWords(service.service)}</h2>
      <${Facts} of=${[
        ["Parts", partsText(figures)],
        ["Processor", cpu === null ? null : `${Math.round(cpu * 100)} % of a core`],
        ["Memory", megabytes(sumOf(figures, "process_resident_memory_bytes"))],
        ["Requests", perSecond(rate("skyway_http_requests_total"))],
        ["Samples", perSecond(rate("skyway_telemetry_written_total"))],
        ["Drones' messages", seconds(sumOf(figures, "skyway_drone_lag_max_seconds"))],
        ["Live picture", seconds(sumOf(figures, "skyway_live_age_seconds"))],
        ["Viewers", sumOf(figures, "skyway_live_viewers")],
        ["Runs for", started === null ? null : durationText(Date.now() / 1000 - started)],
      ]} />
    </article>`;
}

const SERVICE = ["Service", ({service}) => inWords(service)];

const Queues = ({services}) => html`
  <h2>Queues</h2>
  <${Table} label="Queues" items=${queues(services)} columns=${[
    SERVICE, ["What waits", ({name}) => name],
    ["How much", ({depth}) => depth, "number"],
    ["For how long", ({ageS}) => (ageS === null ? "" : durationText(ageS)), "number"],
  ]} />`;

function LastErrors({services}) {
  const found = services
    .flatMap(({service, last_errors: errors}) => errors.map((each) => ({service, ...each})))
    .sort((one, other) => other.wall_at.localeCompare(one.wall_at));
  return html`
    <h2>Last errors and warnings</h2>
    ${found.length === 0 ? html`<p>None since the start.</p>` : html`
      <${Table} label="Last errors and warnings" items=${found} columns=${[
        ["When", ({wall_at: at}) => dayText(at)], SERVICE,
        ["What", ({level, event, reason, trace_id: trace}) => html`
          <span class="tag ${level}">${inWords(level)}</span> ${event}
          ${reason && html`<br /><small>${reason}</small>`}
          ${trace && html`<br /><small>trace ${trace}</small>`}`, "wide-cell"],
        ["How often", ({times}) => times, "number"],
      ]} />`}`;
}

function Failures({services}) {
  const found = failures(services);
  return found.length > 0 && html`
    <h2>Counted failures</h2>
    <${Table} label="Counted failures" items=${found} columns=${[
      SERVICE, ["What", ({name}) => name], ["How often", ({count}) => count, "number"],
    ]} />`;
}

export function HealthView() {
  // Two looks, because rates need an earlier one.
  const looks = useRef([]);
  const look = async () => {
    const {services} = await get("/v1/system");
    looks.current = [{at: performance.now(), services}, looks.current[0]];
    return looks.current;
  };
  const {answer, problem} = useRead(look, {everyMs: EVERY_MS});
  const [now, last] = answer ?? [];
  if (!now) return html`<div class="page"><p>${problem || "Reading…"}</p></div>`;
  const elapsedS = last ? (now.at - last.at) / 1000 : null;
  return html`
    <div class="page">
      <h1>Health</h1>
      ${problem && html`<p class="refused">${problem}</p>`}
      <div class="columns">
        ${now.services.map((service) => html`
          <${Service} key=${service.service} service=${service} elapsedS=${elapsedS}
            before=${last?.services.find((each) => each.service === service.service)} />`)}
      </div>
      <div class="columns">
        <section><${Queues} services=${now.services} /><${Promises} /></section>
        <section><${LastErrors} services=${now.services} /><${Failures} services=${now.services} /></section>
      </div>
      <p class="hint">The services' logs say more. Prometheus reads the same numbers at /metrics.</p>
    </div>`;
}
