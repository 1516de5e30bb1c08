// The events of a delivery, as webhooks and event streams carry them.

import { EventSourceParserStream } from 'eventsource-parser/stream'
import { Webhook } from 'standardwebhooks'

import type { webhooks } from './schema.js'

type Received<Name extends keyof webhooks> =
  webhooks[Name]['post']['requestBody']['content']['application/json']

/** An event of a delivery: `type` says which. */
export type DeliveryEvent = Received<'delivery-event'>

/** The event that tries out a webhook. */
export type TrialEvent = Received<'webhook-test'>

/** How long a reader waits before it opens a broken stream again, ms. */
const REOPEN_AFTER_MS = 1000

/**
 * The events of a delivery, until its last one. A stream that breaks is opened again after the last
 * event that came. `open` answers null when no more events come.
 */
export async function* eventsFrom(
  open: (after: number) => Promise<ReadableStream<BufferSource> | null>,
  after: number,
): AsyncGenerator<DeliveryEvent> {
  for (;;) {
    const stream = await open(after)
    if (stream === null) return
    const frames = stream
      .pipeThrough(new TextDecoderStream())
      .pipeThrough(new EventSourceParserStream())
    try {
      for await (const frame of frames) {
        after = Number(frame.id)
        yield JSON.parse(frame.data) as DeliveryEvent
      }
    } catch (error) {
      if (!(error instanceof TypeError)) throw error // what fetch throws for a broken connection
      await new Promise((resolve) => setTimeout(resolve, REOPEN_AFTER_MS))
    }
  }
}

/**
 * The event of a notification that Skyway signed within the last five minutes; else it throws a
 * `WebhookVerificationError`. A notification may arrive twice: remember the header `webhook-id`.
 */
export function readNotification(
  secret: string,
  headers: Record<string, string>,
  body: string,
): DeliveryEvent | TrialEvent {
  return new Webhook(secret).verify(body, headers) as DeliveryEvent | TrialEvent
}
