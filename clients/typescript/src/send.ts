// Sends requests again where that does nothing twice, and throws what the server refuses.

import { SkywayError, type Problem } from './errors.js'
import { BY_CODE, BY_TYPE, KEYED_PATHS } from './problems.js'

/** A server that asks for a longer wait gets no other attempt, seconds. */
const LONGEST_WAIT_S = 60
const FIRST_WAIT_S = 0.1
const MAY_PASS = new Set([429, 500, 503])
const REPEATABLE = new Set(['GET', 'PUT', 'DELETE'])

/** The `fetch` of a client: it answers only with success. */
export function sender({ mostAttempts, timeoutS }: { mostAttempts: number; timeoutS: number }) {
  return async (request: Request): Promise<Response> => {
    const keyed = withIdempotencyKey(request)
    for (let attempt = 1; ; attempt++) {
      try {
        return await sendOnce(keyed.clone(), timeoutS)
      } catch (error) {
        const waitS = attempt < mostAttempts ? waitBefore(attempt, error, keyed) : null
        if (waitS === null) throw error
        await new Promise((resolve) => setTimeout(resolve, waitS * 1000))
      }
    }
  }
}

function withIdempotencyKey(request: Request): Request {
  const { pathname } = new URL(request.url)
  const takesKey = request.method === 'POST' && KEYED_PATHS.some((path) => path.test(pathname))
  if (takesKey && !request.headers.has('idempotency-key'))
    request.headers.set('idempotency-key', crypto.randomUUID())
  return request
}

async function sendOnce(request: Request, timeoutS: number): Promise<Response> {
  const response = await fetch(request, { signal: AbortSignal.timeout(timeoutS * 1000) })
  if (!response.ok) throw await errorOf(response)
  return response
}

/** The error of the class that fits the type and the code of a problem document. */
export async function errorOf(response: Response): Promise<SkywayError> {
  const problem = (await response.json().catch(() => ({}))) as Problem
  const retryAfter = Number.parseInt(response.headers.get('retry-after') ?? '', 10)
  const ByCode = problem.code ? BY_CODE[problem.code] : undefined
  const Kind = ByCode ?? BY_TYPE[problem.type ?? ''] ?? SkywayError
  return new Kind(response.status, problem, Number.isNaN(retryAfter) ? null : retryAfter)
}

/** After how many seconds to send it again; null if the error stands. */
function waitBefore(attempt: number, error: unknown, request: Request): number | null {
  const isRepeatable = REPEATABLE.has(request.method) || request.headers.has('idempotency-key')
  const backoffS = FIRST_WAIT_S * 2 ** attempt * (1 + Math.random())
  if (!(error instanceof SkywayError)) return isRepeatable ? backoffS : null
  if (!MAY_PASS.has(error.status) || (error.status !== 429 && !isRepeatable)) return null
  if (error.retryAfterS === null) return backoffS
  return error.retryAfterS <= LONGEST_WAIT_S ? error.retryAfterS : null
}
