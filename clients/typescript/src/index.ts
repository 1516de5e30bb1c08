/** Order deliveries from Skyway: typed by its OpenAPI document. */

import createClient, { type Client } from 'openapi-fetch'

import { eventsFrom, type DeliveryEvent } from './events.js'
import type { components, paths } from './schema.js'
import { sender } from './send.js'

export { SkywayError, type Problem } from './errors.js'
export { readNotification, type DeliveryEvent, type TrialEvent } from './events.js'
export * as problems from './problems.js'
export type { paths } from './schema.js'

/** The models of the API by name: `Schemas['Delivery']`. */
export type Schemas = components['schemas']

export interface Options {
  /** Of the gateway: `http://127.0.0.1:8000`. */
  url: string
  /** `sk_...` */
  key: string
  /** How often a call is sent at most, from 1; 5 by default. */
  mostAttempts?: number
  /** How long an answer may take, seconds; 30 by default. */
  timeoutS?: number
}

export interface Skyway {
  /** Typed calls by path: `skyway.api.GET('/v1/deliveries')`. They throw a SkywayError. */
  api: Client<paths>
  /** The events of a delivery after this sequence (0 by default), until its last one. */
  events(deliveryId: string, after?: number): AsyncGenerator<DeliveryEvent>
}

/** A client of one gateway with one key. */
export function createSkyway({ url, key, mostAttempts = 5, timeoutS = 30 }: Options): Skyway {
  const headers = { authorization: `Bearer ${key}` }
  const api = createClient<paths>({
    baseUrl: url,
    headers,
    fetch: sender({ mostAttempts, timeoutS }),
  })
  // A stream lasts as long as its delivery.
  const openStream = sender({ mostAttempts, timeoutS: 24 * 3600 })
  const open = async (deliveryId: string, after: number) => {
    const path = `${url}/v1/deliveries/${encodeURIComponent(deliveryId)}/events`
    const response = await openStream(
      new Request(path, { headers: { ...headers, 'last-event-id': String(after) } }),
    )
    return response.status === 204 ? null : response.body
  }
  return { api, events: (deliveryId, after = 0) => eventsFrom((last) => open(deliveryId, last), after) }
}

/** The answer of a call: `await answer(skyway.api.GET('/v1/deliveries'))`. */
export async function answer<Data>(call: Promise<{ data?: Data }>): Promise<Data> {
  return (await call).data as Data
}

interface Page<Item> {
  items: Item[]
  next_cursor?: string | null
}

/** The items of all pages: `each((cursor) => answer(skyway.api.GET(path, { params: { query: { cursor } } })))`. */
export async function* each<Item>(
  page: (cursor: string | null) => Promise<Page<Item>>,
): AsyncGenerator<Item> {
  let cursor: string | null = null
  do {
    const { items, next_cursor } = await page(cursor)
    yield* items
    cursor = next_cursor ?? null
  } while (cursor !== null)
}
