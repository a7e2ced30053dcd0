function client = fretwork(base, key)
% FRETWORK  A server of fretwork, for MATLAB and Octave. Both send their requests with the program curl.
%
%   client = fretwork()                          the server at http://127.0.0.1:8080
%   client = fretwork(base, key)                 another server, which may require an access key
%
%   job = client.submit(body)                    submits struct('scenario', ...), and returns the job at once
%   job = client.wait(job)                       waits for the end of the job; an error, if it has no result
%   result = client.result(job)                  the whole result, in SI units
%   columns = client.table(job, 'history')       one part: history, profiles or loops of a run, table of a study
%   columns = client.table(job, 'history', 'units=engineering&cycles=1000')
%   answer = client.request('GET', '/v1/jobs')   any request of the API; a third argument is sent as JSON
%
% A list with one entry must be a cell, such as scenario.cycles = {1000}: MATLAB writes [1000] as a number.
  if nargin < 1, base = 'http://127.0.0.1:8080'; end
  if nargin < 2, key = ''; end
  client.request = @(method, path, varargin) request(base, key, method, path, {}, varargin{:});
  client.submit = @(body) request(base, key, 'POST', '/v1/jobs', {['Idempotency-Key: ' once()]}, body);
  client.wait = @(job) wait(client.request, job);
  client.result = @(job) client.request('GET', ['/v1/results/' job.key]);
  client.table = @(job, part, varargin) table_of(client.request, job, part, varargin{:});
end

function job = wait(ask, job)
  while any(strcmp(job.state, {'queued', 'running', 'canceling'}))
    job = ask('GET', ['/v1/jobs/' job.id '?wait=30']);
  end
  if ~strcmp(job.state, 'succeeded')
    reason = '';
    if isfield(job, 'error') && isstruct(job.error), reason = [': ' job.error.title '. ' job.error.detail]; end
    error('fretwork:job', '%s', ['The job is ' job.state reason]);
  end
end

function columns = table_of(ask, job, part, words)
  if nargin < 4, words = ''; end
  answer = ask('GET', ['/v1/results/' job.key '/' part '?' words]);
  columns = answer.(part);
end

function answer = request(base, key, method, path, headers, body)
  % curl reads its options from a file, so that no other user sees the key. On Windows, the directory is private already.
  names = {tempname(), tempname(), tempname()};
  [options, sent, received] = names{:};
  tidy = onCleanup(@() remove(names));
  if isunix(), system(['umask 077; touch "' options '" "' sent '" "' received '"']); end
  headers = [headers, {'Accept: application/json'}];
  if ~isempty(key), headers{end + 1} = ['Authorization: Bearer ' key]; end
  lines = {['request = "' method '"'], ['url = "' base path '"'], ['output = "' strrep(received, '\', '/') '"']};
  if nargin > 5
    write(sent, jsonencode(body));
    headers{end + 1} = 'Content-Type: application/json';
    lines{end + 1} = ['data-binary = "@' strrep(sent, '\', '/') '"'];
  end
  if ~strcmp(method, 'POST') || any(strncmp(headers, 'Idempotency-Key', 15))
    % curl waits 1, 2, 4, 8 and 16 s, or as the server asks.
    lines = [lines, {'retry = 5', 'retry-connrefused'}];
  end
  lines = [lines, {'write-out = "%{http_code}"', 'no-progress-meter', 'location'}, strcat({'header = "'}, headers, {'"'})];
  write(options, sprintf('%s\n', lines{:}));
  % The libraries of MATLAB are not those of curl.
  if isunix(), program = 'env -u LD_LIBRARY_PATH curl'; else, program = 'curl'; end
  [~, status] = system([program ' -q -K "' options '"']);
  text = fileread(received);
  status = str2double(regexp(status, '\d{3}\s*$', 'match', 'once'));
  if isnan(status) || status == 0
    error('fretwork:lost', '%s', [base ' does not answer. Check that the server runs, and its address.']);
  end
  answer = [];
  if ~isempty(strtrim(text)), answer = decoded(text); end
  if status >= 400, error('fretwork:problem', '%s', said(answer, status)); end
end

function answer = decoded(text)
  % Metrics and figures are no JSON.
  answer = text;
  if any(text(1) == '{[')
    answer = jsondecode(text);
  end
end

function text = said(problem, status)
  % The detail of an error answer (RFC 9457) and all faults of the request.
  text = sprintf('The server answered with status %d', status);
  if ~isstruct(problem) || ~isfield(problem, 'detail'), return, end
  text = problem.detail;
  if ~isfield(problem, 'errors'), return, end
  for i = 1:numel(problem.errors)
    fault = problem.errors(i);
    if iscell(fault), fault = fault{1}; end
    place = '';
    if isfield(fault, 'pointer'), place = fault.pointer; end
    text = sprintf('%s\n  %s: %s', text, place, fault.detail);
  end
end

function key = once()
  % A key for one submission, so that the server knows it if it is sent twice.
  [~, key] = fileparts(tempname());
  key = [key '-' sprintf('%.9f', now())];
end

function write(name, text)
  file = fopen(name, 'w');
  fwrite(file, unicode2native(text, 'UTF-8'));
  fclose(file);
end

function remove(names)
  for i = 1:numel(names)
    if exist(names{i}, 'file'), delete(names{i}); end
  end
end
