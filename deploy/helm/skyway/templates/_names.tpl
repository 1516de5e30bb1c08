{{/* The beginning of all names: at most 40 characters, so that every name stays below 63. */}}
{{- define "skyway.fullname" -}}
{{- if .Values.fullnameOverride -}}
{{- .Values.fullnameOverride | trunc 40 | trimSuffix "-" -}}
{{- else if contains "skyway" .Release.Name -}}
{{- .Release.Name | trunc 40 | trimSuffix "-" -}}
{{- else -}}
{{- printf "%s-skyway" .Release.Name | trunc 40 | trimSuffix "-" -}}
{{- end -}}
{{- end -}}

{{/* Labels that select pods; they never change. Arguments: root, name of the part. */}}
{{- define "skyway.selector" -}}
app.kubernetes.io/name: skyway
app.kubernetes.io/instance: {{ .root.Release.Name }}
app.kubernetes.io/component: {{ .name }}
{{- end -}}

{{- define "skyway.labels" -}}
{{ include "skyway.selector" . }}
app.kubernetes.io/part-of: skyway
app.kubernetes.io/version: {{ .root.Chart.AppVersion | quote }}
app.kubernetes.io/managed-by: {{ .root.Release.Service }}
helm.sh/chart: {{ printf "%s-%s" .root.Chart.Name .root.Chart.Version | replace "+" "_" }}
{{- end -}}

{{- define "skyway.image" -}}
{{ .Values.image.repository }}:{{ .Values.image.tag | default .Chart.AppVersion }}
{{- end -}}

{{/* All servers of composition, as JSON: the first one, and that of each cell. `service` names its
     values, `name` is its component, and `host` is empty if its database is on `database.host`. */}}
{{- define "skyway.compositions" -}}
{{- $fullname := include "skyway.fullname" . -}}
{{- $first := dict "name" "composition" "service" "composition" "database" "skyway_composition" "host" "" "secret" .Values.secrets.composition "replicas" .Values.composition.replicas "networks" list -}}
{{- $all := list $first -}}
{{- $seen := dict -}}
{{- range .Values.cells -}}
{{- $name := printf "cell-%s" .name -}}
{{- if gt (len (printf "%s-migrate-%s" $fullname $name)) 63 -}}
{{- fail (printf "cells: the name %s is too long for %s-migrate-%s: choose a shorter one" .name $fullname $name) -}}
{{- end -}}
{{- range concat (list $name) .networks -}}
{{- if hasKey $seen . -}}
{{- fail (printf "cells: %s is there twice, and only one cell serves a network" (trimPrefix "cell-" .)) -}}
{{- end -}}
{{- $_ := set $seen . true -}}
{{- end -}}
{{- $cell := dict "name" $name "service" "composition" "database" (printf "skyway_%s" (replace "-" "_" $name)) "host" (.databaseHost | default "") "secret" (.secret | default $.Values.secrets.composition) "replicas" (.replicas | default $.Values.composition.replicas) "networks" .networks -}}
{{- $all = append $all $cell -}}
{{- end -}}
{{- toJson $all -}}
{{- end -}}

{{/* The addresses of a broker outside, separated by commas. Arguments: outside, port. */}}
{{- define "skyway.outsideBroker" -}}
{{- $scheme := printf "%s%s" (ternary "mqtts" "mqtt" .outside.tls) (ternary "+nats" "" (eq .outside.kind "nats")) -}}
{{- $urls := list -}}
{{- range splitList "," .outside.host -}}
{{- $urls = append $urls (printf "%s://%s:%d" $scheme . (int $.port)) -}}
{{- end -}}
{{- join "," $urls -}}
{{- end -}}

{{/* The broker's listener for services, as everybody but the registry's own pod sees it. */}}
{{- define "skyway.mqttUrl" -}}
{{- if eq .Values.broker.mode "sidecar" -}}
mqtt://{{ include "skyway.fullname" . }}-broker:1884
{{- else -}}
{{ include "skyway.outsideBroker" (dict "outside" .Values.broker.outside "port" .Values.broker.outside.port) }}
{{- end -}}
{{- end -}}

{{/* The broker's listener for drones inside of the cluster. */}}
{{- define "skyway.droneMqttUrl" -}}
{{- if eq .Values.broker.mode "sidecar" -}}
mqtt://{{ include "skyway.fullname" . }}-broker:1883
{{- else -}}
{{ include "skyway.outsideBroker" (dict "outside" .Values.broker.outside "port" .Values.broker.outside.dronePort) }}
{{- end -}}
{{- end -}}
