// The first page of each role: how is it going?

import {html} from "../html.js";
import {session} from "../session.js";
import {EmptyHint} from "../parts/empty_hint.js";
import {CustomerHome} from "../parts/home_customer.js";
import {OperatorHome} from "../parts/home_operator.js";
import {ProviderHome} from "../parts/home_provider.js";

const HOMES = {operator: OperatorHome, provider: ProviderHome, customer: CustomerHome};

export const HomeView = () => html`
  <div class="page home">
    <${HOMES[session.value.role]} />
    <${EmptyHint} />
  </div>`;
